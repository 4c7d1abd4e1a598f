"""The lights of a SUMO episode as seen from outside: what they show, since when, and who runs them."""

from __future__ import annotations

from typing import Any

from stylesim.signals import SignalState
from stylesim.simulation.sumo.episode import DT_S
from stylesim.simulation.sumo.roads import RoadNetwork
from stylesim.simulation.sumo.signals import STATES, main_link


class LightWatch:
    """Follows the network's lights: what they show, since when, and who crosses a stop line on red."""

    def __init__(self, sumo: Any, network: RoadNetwork) -> None:
        self._sumo = sumo
        self._step = 0
        self._shown = dict.fromkeys(network.signals(), "")
        self._onset: dict[str, list[int]] = {}
        lanes = network.controlled_lanes()
        self._links = {lane: [link for link in network.links if link.lane == lane] for lane in lanes}
        self._main = [main_link(self._links[lane]) for lane in lanes]
        self._on_lane: dict[str, set[str]] = {lane: set() for lane in lanes}

    def after_step(self, step: int) -> list[str]:
        """Take in a step; returns who has crossed a stop line while all its links were red."""
        self._step = step
        for light, before in self._shown.items():
            shown = str(self._sumo.trafficlight.getRedYellowGreenState(light))
            if shown != before:
                self._shown[light] = shown
                self._follow_change(light, before or " " * len(shown))
        runners: list[str] = []
        for lane, before_ids in self._on_lane.items():
            now = set(self._sumo.lane.getLastStepVehicleIDs(lane))
            if before_ids - now and self._is_red(lane):
                runners += sorted(name for name in before_ids - now if self._inside_junction(name))
            self._on_lane[lane] = now
        return runners

    def _follow_change(self, light: str, before: str) -> None:
        shown = self._shown[light]
        onset = self._onset.get(light) or [self._step] * len(shown)
        changed = [old.lower() != new.lower() for old, new in zip(before, shown, strict=True)]
        self._onset[light] = [self._step if new else old for new, old in zip(changed, onset, strict=True)]

    def _is_red(self, lane: str) -> bool:
        return all(STATES.get(self._shown[link.signal][link.index]) is SignalState.RED for link in self._links[lane])

    def _inside_junction(self, name: str) -> bool:
        vehicle = self._sumo.vehicle
        return name in vehicle.getIDList() and vehicle.getRoadID(name).startswith(":")

    def shown_since(self, link: tuple[str, int]) -> tuple[SignalState, float]:
        """What one link (light, index) is shown, and for how many seconds it has been."""
        light, index = link
        state = STATES.get(self._shown[light][index], SignalState.UNKNOWN)
        return state, (self._step - self._onset[light][index]) * DT_S

    def by_lane(self) -> list[SignalState]:
        """What each controlled lane is shown: its straight movement's light if it has one."""
        return [STATES.get(self._shown[link.signal][link.index], SignalState.UNKNOWN) for link in self._main]
