"""The light of a SUMO episode as seen from outside: what it shows, since when, and who runs it."""

from __future__ import annotations

from typing import Any

from stylesim.signals import SignalState
from stylesim.simulation.sumo.episode import DT_S
from stylesim.simulation.sumo.roads import RoadNetwork
from stylesim.simulation.sumo.signals import STATES


class LightWatch:
    """Follows the scenario's one light: what it shows, since when, and who crosses a stop line on red."""

    def __init__(self, sumo: Any, network: RoadNetwork, light: str) -> None:
        self._sumo, self._light = sumo, light
        self._step = 0
        self._shown, self._before = "", ""
        self._onset: list[int] = []
        lanes = network.controlled_lanes()
        self._links = {lane: [link.index for link in network.links if link.lane == lane] for lane in lanes}
        self._main = [_main_link(network, lane) for lane in lanes]
        self._on_lane: dict[str, set[str]] = {lane: set() for lane in lanes}

    def after_step(self, step: int) -> list[str]:
        """Take in a step; returns who has crossed a stop line while all its links were red."""
        self._step, self._before = step, self._shown
        self._shown = str(self._sumo.trafficlight.getRedYellowGreenState(self._light))
        if self._shown != self._before:
            before, onset = self._before or " " * len(self._shown), self._onset or [step] * len(self._shown)
            changed = [old.lower() != new.lower() for old, new in zip(before, self._shown, strict=True)]
            self._onset = [step if new else old for new, old in zip(changed, onset, strict=True)]
        runners: list[str] = []
        for lane, before_ids in self._on_lane.items():
            now = set(self._sumo.lane.getLastStepVehicleIDs(lane))
            if before_ids - now and self._is_red(lane):
                runners += sorted(name for name in before_ids - now if self._inside_junction(name))
            self._on_lane[lane] = now
        return runners

    def _is_red(self, lane: str) -> bool:
        return all(STATES.get(self._shown[link]) is SignalState.RED for link in self._links[lane])

    def _inside_junction(self, name: str) -> bool:
        vehicle = self._sumo.vehicle
        return name in vehicle.getIDList() and vehicle.getRoadID(name).startswith(":")

    def shown_since(self, link: int) -> tuple[SignalState, float]:
        """What one link is shown, and for how many seconds it has been."""
        return STATES.get(self._shown[link], SignalState.UNKNOWN), (self._step - self._onset[link]) * DT_S

    def by_lane(self) -> list[SignalState]:
        """What each controlled lane is shown: its straight movement's light if it has one."""
        return [STATES.get(self._shown[link], SignalState.UNKNOWN) for link in self._main]


def _main_link(network: RoadNetwork, lane: str) -> int:
    links = [link for link in network.links if link.lane == lane]
    return min(links, key=lambda link: (link.direction != "s", link.index)).index
