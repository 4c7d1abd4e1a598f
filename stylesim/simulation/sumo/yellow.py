"""Carries the drivers' decisions at yellow into SUMO: when a light has changed, who decides what.

SUMO by itself stops whoever can, which is a step and never a curve. Here nobody reacts to a yellow within the step
in which it comes (`jmDriveAfterYellowTime`, `ONSET_S`); then every driver within 250 m whose way leads over a link
that turned yellow decides once (`driving.decide_at_yellow`, a stream of its own per driver and yellow), and its
vehicle type is told:

* go: `jmDriveAfterRedTime` = the style's `red_running_s`, which makes it drive at any yellow and that long at red;
* stop: `jmDriveAfterYellowTime` = its brake response, so that it drives on until then and brakes afterwards, and
  its wished deceleration for this stop. How hard it really brakes, EIDM decides from the distance left.

Both are taken back when the light is green again. Who is farther away stops, as SUMO does.
"""

from __future__ import annotations

from dataclasses import dataclass

from stylesim.simulation.driving import YellowDecision, decide_at_yellow
from stylesim.simulation.sumo.engine import SumoApi
from stylesim.simulation.sumo.episode import Episode
from stylesim.simulation.sumo.signals import ONSET_S

AFTER_YELLOW = "junctionModel.jmDriveAfterYellowTime"
AFTER_RED = "junctionModel.jmDriveAfterRedTime"
OFF = "-1"
AT_ONSET = f"{ONSET_S:.2f}"
HORIZON_M = 250.0  # who is farther away at the onset of yellow does not decide; at 20 m/s that is 12 s


@dataclass(frozen=True)
class DecisionEvent:
    """A driver's decision at one yellow."""

    step: int
    driver_id: str
    stop: bool
    speed_mps: float
    distance_m: float


class YellowController:
    """Watches the signals of one episode; call `before_step` ahead of every simulation step."""

    def __init__(self, sumo: SumoApi, files: Episode) -> None:
        self._sumo, self._files = sumo, files
        self._shown = dict.fromkeys(files.signals, "")
        self._changed: dict[str, tuple[str, int]] = {}  # driver -> the link whose green takes its change back
        self._decided: dict[str, YellowDecision] = {}  # and what it decided there
        self._times_decided: dict[str, int] = {}
        self.events: list[DecisionEvent] = []

    def before_step(self, step: int) -> None:
        """Looks which lights the step before has turned yellow; who is near one decides now."""
        onsets: set[tuple[str, int]] = set()
        for signal, before in self._shown.items():
            now = self._sumo.trafficlight.getRedYellowGreenState(signal)
            if now == before:
                continue
            self._shown[signal] = now
            pairs = enumerate(zip(before, now, strict=False))
            onsets |= {(signal, link) for link, (old, new) in pairs if old in "Gg" and new in "yY"}
            self._release(signal, now)
        if onsets:
            self._ask(onsets, step - 1)

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
        decision = decide_at_yellow(style, speed_mps=speed, distance_m=distance_m, rng=rng)
        self._apply(driver_id, decision)
        self._changed[driver_id], self._decided[driver_id] = link, decision
        self.events.append(DecisionEvent(step, driver_id, decision.stop, speed, distance_m))

    def _apply(self, driver_id: str, decision: YellowDecision) -> None:
        types, driver = self._sumo.vehicletype, self._files.now[driver_id]
        after_red = OFF if decision.stop else f"{driver.style.red_running_s:.2f}"
        types.setParameter(driver.type_id, AFTER_RED, after_red)
        types.setParameter(driver.type_id, AFTER_YELLOW, f"{decision.response_s:.2f}" if decision.stop else AT_ONSET)
        if decision.stop:
            types.setDecel(driver.type_id, decision.deceleration_mps2)

    def tell_again(self, driver_id: str) -> None:
        """What the driver has decided at a light that is still ahead holds for its new vehicle type, too."""
        if driver_id in self._changed:
            self._apply(driver_id, self._decided[driver_id])

    def _release(self, signal: str, shown: str) -> None:
        """Gives the drivers whose light is green again their ordinary selves back."""
        types = self._sumo.vehicletype
        for driver_id, (theirs, link) in list(self._changed.items()):
            if theirs == signal and shown[link] in "Gg":
                del self._changed[driver_id]
                driver = self._files.now[driver_id]
                types.setParameter(driver.type_id, AFTER_YELLOW, AT_ONSET)
                types.setParameter(driver.type_id, AFTER_RED, OFF)
                types.setDecel(driver.type_id, driver.style.comfortable_deceleration_mps2)
