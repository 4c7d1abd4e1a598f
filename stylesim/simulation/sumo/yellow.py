"""Carries the drivers' decisions at yellow into SUMO: when a light has changed, who decides what, and how it is done.

SUMO by itself stops whoever can, which is a step and never a curve. Here nobody reacts to a yellow within the step
in which it comes (`jmDriveAfterYellowTime`, `ONSET_S`); then every driver within 250 m whose way leads over a link
that turned yellow decides once (`driving.decide_at_yellow`, a stream of its own per driver and yellow). From then on
SUMO does not stop it at that light (`jmDriveAfterYellowTime`, `jmDriveAfterRedTime`); it still keeps it off others:

* stop: it goes on until its brake response is over, then brakes as `stopping.StopPlan` says. Once it stands SUMO
  holds it at the line.
* go: it crosses, also on red. At the onset of red it gives up if it would cross later than the style's
  `red_running_s` and can still stop without an emergency; then it brakes as above.

SUMO takes over again when the front is over the line or the light is green. Who is farther away at the onset stops as
SUMO does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from stylesim.simulation.driving import YellowDecision, decide_at_yellow, wished_deceleration
from stylesim.simulation.stopping import EMERGENCY_MPS2, HARD_MPS2, STANDING_MPS, StopPlan, latest_response_s
from stylesim.simulation.sumo.clearing import JunctionClearing
from stylesim.simulation.sumo.engine import SumoApi
from stylesim.simulation.sumo.episode import DT_S, Episode
from stylesim.simulation.sumo.signals import ONSET_S

AFTER_YELLOW = "junctionModel.jmDriveAfterYellowTime"
AFTER_RED = "junctionModel.jmDriveAfterRedTime"
OFF, ALWAYS = "-1", "1000"
AT_ONSET = f"{ONSET_S:.2f}"
HORIZON_M = 250.0  # who is farther away at the onset of yellow does not decide; at 20 m/s that is 12 s
OVER_M = 0.5  # beyond the line; SUMO's light is behind it then
# What SUMO's speed mode is without: braking no harder than the type's `decel`, and braking for who crosses on green,
# because it does not know that the driver will stop
WHILE_STOPPING = ~0b01100
SUMO_DRIVES = -1.0


@dataclass(frozen=True)
class DecisionEvent:
    """A driver's decision at one yellow, and whether it went only because nobody could have stopped."""

    step: int
    driver_id: str
    stop: bool
    speed_mps: float
    distance_m: float
    impossible: bool = False
    gave_up: bool = False  # decided to go, and stopped at the onset of red after all


@dataclass
class _Approach:
    """A driver between its decision and the line."""

    signal: str
    link: int
    number: int  # of the driver's decisions
    event: int  # the decision's place among all
    distance_m: float
    plan: StopPlan | None  # None: it goes
    holds: bool = False  # it stands, and SUMO holds it
    mode: int | None = None  # SUMO's speed mode before its speed was set here; None while SUMO chooses it


class YellowController:
    """Watches the signals of one episode; call `before_step` ahead of every simulation step."""

    def __init__(self, sumo: SumoApi, files: Episode) -> None:
        self._sumo, self._files = sumo, files
        self._shown = dict.fromkeys(files.signals, "")
        self._wet = bool(files.parameters.get("wet_road", 0.0))
        self._clearing = JunctionClearing(sumo, files)
        self._under_way: dict[str, _Approach] = {}
        self._times_decided: dict[str, int] = {}
        self.events: list[DecisionEvent] = []

    def before_step(self, step: int) -> None:
        """Looks which lights the step before has changed; who is near a new yellow decides, who decided drives on."""
        self._drive()
        self._clearing.before_step()
        onsets: set[tuple[str, int]] = set()
        for signal, before in self._shown.items():
            now = self._sumo.trafficlight.getRedYellowGreenState(signal)
            if now == before:
                continue
            self._shown[signal] = now
            changes = list(enumerate(zip(before, now, strict=False)))
            onsets |= {(signal, link) for link, (old, new) in changes if old in "Gg" and new in "yY"}
            self._turned_green(signal, now)
            if green := {link for link, (old, new) in changes if old == "r" and new in "Gg"}:
                self._clearing.turned_green(signal, green)
            if red := {link for link, (old, new) in changes if old in "yY" and new == "r"}:
                self._turned_red(signal, red, step)
                self._clearing.turned_red(signal)
        if onsets:
            self._ask(onsets, step - 1)

    def _drive(self) -> None:
        """Where everybody under way has got to in the last step, and the speed of who brakes."""
        if not self._under_way:
            return
        vehicle = self._sumo.vehicle
        present = set(vehicle.getIDList())
        for driver_id, way in list(self._under_way.items()):
            if driver_id not in present:
                del self._under_way[driver_id]
                continue
            if way.holds:
                continue
            speed = vehicle.getSpeed(driver_id)
            way.distance_m -= speed * DT_S
            if way.plan is not None:
                way.plan.moved(speed, DT_S)
                self._brake(driver_id, way, way.plan, speed)
            if way.distance_m < -OVER_M:
                self._release(driver_id)

    def _brake(self, driver_id: str, way: _Approach, plan: StopPlan, speed_mps: float) -> None:
        speed = plan.next_speed(speed_mps, DT_S)
        if speed_mps <= STANDING_MPS:
            self._give_back(driver_id, way)
            way.holds = True
            self._tell(driver_id, way)
        elif speed is not None:
            self._sumo.vehicle.setSpeed(driver_id, speed)

    def _take(self, driver_id: str, way: _Approach) -> None:
        """Its stop is planned here; SUMO minds the others on its lane."""
        way.mode = self._sumo.vehicle.getSpeedMode(driver_id)
        self._sumo.vehicle.setSpeedMode(driver_id, way.mode & WHILE_STOPPING)

    def _give_back(self, driver_id: str, way: _Approach) -> None:
        """SUMO chooses the driver's speed again."""
        if way.mode is not None:
            self._sumo.vehicle.setSpeed(driver_id, SUMO_DRIVES)
            self._sumo.vehicle.setSpeedMode(driver_id, way.mode)
            way.mode = None

    def _ask(self, onsets: set[tuple[str, int]], step: int) -> None:
        """Everybody whose next yellow light is one of `onsets` decides; an ego of somebody else decides for itself."""
        for driver_id in self._sumo.vehicle.getIDList():
            if driver_id not in self._files.drivers:
                continue
            for signal, link, distance_m, _ in self._sumo.vehicle.getNextTLS(driver_id):
                if distance_m > HORIZON_M:
                    break
                if (signal, link) in onsets:
                    self._decide(driver_id, step, link=(signal, link), distance_m=distance_m)
                    break

    def _decide(self, driver_id: str, step: int, *, link: tuple[str, int], distance_m: float) -> None:
        number = self._times_decided.get(driver_id, 0)
        self._times_decided[driver_id] = number + 1
        rng = self._files.stream(driver_id, f"yellow {number}", step=step)
        style, speed = self._files.now[driver_id].style, self._sumo.vehicle.getSpeed(driver_id)
        decision = decide_at_yellow(style, speed_mps=speed, distance_m=distance_m, rng=rng, wet=self._wet)
        self._release(driver_id)
        plan = _plan(decision, distance_m, speed) if decision.stop else None
        self._under_way[driver_id] = _Approach(*link, number, len(self.events), distance_m, plan)
        self._tell(driver_id, self._under_way[driver_id])
        if plan is not None:
            self._take(driver_id, self._under_way[driver_id])
        self.events.append(
            DecisionEvent(step, driver_id, decision.stop, speed, distance_m, impossible=decision.impossible)
        )

    def _tell(self, driver_id: str, way: _Approach | None) -> None:
        """Whether SUMO stops the driver at lights: not while it is under way to one for which it has decided."""
        types, type_id = self._sumo.vehicletype, self._files.now[driver_id].type_id
        itself = way is not None and not way.holds
        types.setParameter(type_id, AFTER_YELLOW, ALWAYS if itself else AT_ONSET)
        types.setParameter(type_id, AFTER_RED, ALWAYS if itself else OFF)

    def let_go(self, driver_id: str) -> None:
        """The driver is under somebody else's command now: whatever it has decided does not hold any more."""
        self._release(driver_id)

    def tell_again(self, driver_id: str) -> None:
        """What the driver has decided at a light that is still ahead holds for its new vehicle type, too."""
        self._tell(driver_id, self._under_way.get(driver_id))

    def _turned_red(self, signal: str, links: set[int], step: int) -> None:
        """Who goes and would cross too long after red gives up, if it can."""
        for driver_id, way in self._under_way.items():
            if way.signal != signal or way.link not in links or way.plan is not None:
                continue
            style, speed = self._files.now[driver_id].style, self._sumo.vehicle.getSpeed(driver_id)
            if way.distance_m <= speed * style.red_running_s or speed <= STANDING_MPS:
                continue
            late = latest_response_s(speed_mps=speed, distance_m=way.distance_m, deceleration_mps2=HARD_MPS2)
            if late >= 0.0:
                rng = self._files.stream(driver_id, f"gives up {way.number}", step=step)
                wish = wished_deceleration(style, rng)
                way.plan = StopPlan(way.distance_m, 0.0, wish, EMERGENCY_MPS2, speed_mps=speed)
                self._take(driver_id, way)
                self.events[way.event] = replace(self.events[way.event], gave_up=True)

    def _turned_green(self, signal: str, shown: str) -> None:
        for driver_id, way in list(self._under_way.items()):
            if way.signal == signal and shown[way.link] in "Gg":
                self._release(driver_id)

    def _release(self, driver_id: str) -> None:
        """SUMO drives again."""
        way = self._under_way.pop(driver_id, None)
        if way is None:
            return
        self._give_back(driver_id, way)
        self._tell(driver_id, None)


def _plan(decision: YellowDecision, distance_m: float, speed_mps: float) -> StopPlan:
    wish = decision.deceleration_mps2
    return StopPlan(distance_m, decision.response_s, wish, EMERGENCY_MPS2, speed_mps=speed_mps)
