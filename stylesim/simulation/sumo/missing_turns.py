"""Who has not got over in time takes the way that its lane leads to, as people do.

SUMO lets such a driver stand at the end of the wrong lane, then slide over sideways while standing, which no car can;
whoever stood behind it drives off at once, through it as the log has it: 3 of 3 overlaps in 3 episodes of `corridor`
(seed 4242). So a driver who has come to a stop, or nearly, at the line of a lane that does not lead to its next road
goes on along that lane: straight on where there is a choice. Its new way ends where the network does.
"""

from __future__ import annotations

from stylesim.simulation.sumo.engine import SumoApi
from stylesim.simulation.sumo.episode import Episode

LAST_M = 12.0  # before the line; chosen, because a lane cannot be changed in less without standing across two
SLOW_MPS = 3.0  # who is faster may still get over, or is past caring: SUMO stops it
EVERY_STEPS = 5  # a car of that speed moves 1.5 m in that time
LONGEST_WAY = 50  # roads; no shipped network has a longer one, and circles must end
STRAIGHT = "s"  # of SUMO's directions


class MissedTurns:
    """Call `before_step` ahead of every simulation step; `events` says who went another way, and in which step."""

    def __init__(self, sumo: SumoApi, files: Episode) -> None:
        self._sumo, self._drivers = sumo, files.drivers
        self._length_m = {lane: files.network.length_m[lane] for lane in files.network.controlled_lanes()}
        self.events: list[tuple[int, str]] = []

    def before_step(self, step: int) -> None:
        """Every fifth step: looks who is at the end of a wrong lane."""
        if step % EVERY_STEPS:
            return
        vehicle = self._sumo.vehicle
        for lane, length in self._length_m.items():
            for name in self._sumo.lane.getLastStepVehicleIDs(lane):
                if name not in self._drivers or length - vehicle.getLanePosition(name) > LAST_M:
                    continue
                if vehicle.getSpeed(name) < SLOW_MPS:
                    self._look(name, lane, step)

    def _look(self, name: str, lane: str, step: int) -> None:
        vehicle = self._sumo.vehicle
        way, here = vehicle.getRoute(name), vehicle.getRouteIndex(name)
        reached = self._reached(lane)
        if not 0 <= here < len(way) - 1 or not reached or way[here + 1] in {edge for edge, _ in reached}:
            return
        vehicle.setRoute(name, [way[here], *self._onward(lane)])
        self.events.append((step, name))

    def _reached(self, lane: str) -> list[tuple[str, str]]:
        """The roads that a lane leads to, and their first lanes reached; straight on first."""
        links = sorted(self._sumo.lane.getLinks(lane), key=lambda link: (link[6] != STRAIGHT, link[0]))
        return [(link[0].rpartition("_")[0], link[0]) for link in links]

    def _onward(self, lane: str) -> list[str]:
        """From a lane straight on to the end of the network, or until the way would meet itself."""
        edges: list[str] = []
        while len(edges) < LONGEST_WAY:
            ahead = [(edge, next_lane) for edge, next_lane in self._reached(lane) if edge not in edges]
            if not ahead:
                break
            edge, lane = ahead[0]
            edges.append(edge)
        return edges
