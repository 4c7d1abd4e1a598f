"""Carries the drivers' decisions at yellow into SUMO: when the light is about to change, who decides what.

SUMO by itself stops whoever can, which is a step and never a curve. Here every driver within 250 m whose way leads
over a lane that the change concerns decides once, in the step before the change takes effect
(`driving.decide_at_yellow`, a stream of its own per driver and yellow), and its vehicle type is told:

* go: `jmDriveAfterRedTime` = the style's `red_running_s`, which makes it drive at any yellow and that long at red;
* stop: `jmDriveAfterYellowTime` = its brake response, so that it drives on until then and brakes afterwards, and
  its wished deceleration for this stop. How hard it really brakes, EIDM decides from the distance left.

Both are taken back when the light is green again. Who is farther away stops, as SUMO does.
"""

from __future__ import annotations

from dataclasses import dataclass

from stylesim.randomness import stream
from stylesim.simulation.driving import YellowDecision, decide_at_yellow
from stylesim.simulation.sumo.engine import SumoApi
from stylesim.simulation.sumo.episode import DT_S, EpisodeFiles

AFTER_YELLOW = "junctionModel.jmDriveAfterYellowTime"
AFTER_RED = "junctionModel.jmDriveAfterRedTime"
OFF = "-1"
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
    """Watches the signal of one episode; call `before_step` ahead of every simulation step."""

    def __init__(self, sumo: SumoApi, files: EpisodeFiles) -> None:
        self._sumo, self._files = sumo, files
        plan = files.options.signal
        self._signal = plan.junction if plan is not None else ""
        self._links = [link for link in files.network.links if link.signal == self._signal]
        self._lane_of_link = {link.index: link.lane for link in self._links}
        self._next_switch = 0.0
        self._light_changed = True  # in the step before; true at the start, so that the first change is looked up
        self._changed: dict[str, str] = {}  # driver -> the lane whose green takes its change back
        self._times_decided: dict[str, int] = {}
        self.events: list[DecisionEvent] = []

    def before_step(self, step: int) -> None:
        """Looks whether the light changes within the step to come; lanes that have green then get their yellow."""
        if not self._signal:
            return
        light = self._sumo.trafficlight
        if self._light_changed:
            self._light_changed = False
            self._next_switch = light.getNextSwitch(self._signal)
            self._release(self._green_lanes())
        if (step + 0.5) * DT_S < self._next_switch:
            return
        self._light_changed = True
        green = self._green_lanes()
        for driver_id in self._sumo.vehicle.getIDList():
            ahead = self._sumo.vehicle.getNextTLS(driver_id)
            if ahead and ahead[0][0] == self._signal and ahead[0][2] <= HORIZON_M:
                lane = self._lane_of_link[ahead[0][1]]
                if lane in green and driver_id in self._files.drivers:  # an ego of somebody else decides for itself
                    self._decide(driver_id, step, lane=lane, distance_m=ahead[0][2])

    def _green_lanes(self) -> set[str]:
        states = self._sumo.trafficlight.getRedYellowGreenState(self._signal)
        return {link.lane for link in self._links if states[link.index] in "Gg"}

    def _decide(self, driver_id: str, step: int, *, lane: str, distance_m: float) -> None:
        number = self._times_decided.get(driver_id, 0)
        self._times_decided[driver_id] = number + 1
        rng = stream(self._files.seed, self._files.episode, driver_id, f"yellow {number}")
        style, speed = self._files.drivers[driver_id].style, self._sumo.vehicle.getSpeed(driver_id)
        decision = decide_at_yellow(style, speed_mps=speed, distance_m=distance_m, rng=rng)
        self._apply(driver_id, decision)
        self._changed[driver_id] = lane
        self.events.append(DecisionEvent(step, driver_id, decision.stop, speed, distance_m))

    def _apply(self, driver_id: str, decision: YellowDecision) -> None:
        types = self._sumo.vehicletype
        if decision.stop:
            types.setParameter(driver_id, AFTER_YELLOW, f"{decision.response_s:.2f}")
            types.setDecel(driver_id, decision.deceleration_mps2)
        else:
            types.setParameter(driver_id, AFTER_RED, f"{self._files.drivers[driver_id].style.red_running_s:.2f}")

    def _release(self, green: set[str]) -> None:
        """Gives the drivers whose lane has green again their ordinary selves back."""
        types = self._sumo.vehicletype
        for driver_id in [name for name, lane in self._changed.items() if lane in green]:
            del self._changed[driver_id]
            types.setParameter(driver_id, AFTER_YELLOW, OFF)
            types.setParameter(driver_id, AFTER_RED, OFF)
            types.setDecel(driver_id, self._files.drivers[driver_id].style.comfortable_deceleration_mps2)
