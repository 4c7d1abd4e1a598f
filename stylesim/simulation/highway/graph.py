"""Which lane goes on in which: the joints of a network, and the way along a route."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane, CircularLane, SineLane
from highway_env.road.road import RoadNetwork

JOINT_M = 0.5  # chosen: lanes whose ends are nearer than this are one path

LaneIndex = tuple[str, str, int]


def joins(lane: AbstractLane, following: AbstractLane) -> bool:
    """True where one lane goes on in the other; highway-env's exits and entries share a node without touching."""
    return bool(np.linalg.norm(lane.position(lane.length, 0.0) - following.position(0.0, 0.0)) < JOINT_M)


def bend_radius_m(lane: AbstractLane) -> float:
    """Smallest radius of the lane's centre line, m: of a circle its own, of a sine 1 / (A w^2); straight: infinite."""
    if isinstance(lane, CircularLane):
        return float(lane.radius)
    if isinstance(lane, SineLane):
        return 1.0 / max(abs(lane.amplitude) * lane.pulsation**2, 1e-9)
    return math.inf


class LaneGraph:
    """Successors and predecessors of every lane, by geometry, worked out once."""

    def __init__(self, network: RoadNetwork) -> None:
        lanes = network.lanes_dict()
        self.length_m = {index: float(lane.length) for index, lane in lanes.items()}
        self.beside = {index[:2]: len(network.graph[index[0]][index[1]]) for index in lanes}
        self.against: frozenset[LaneIndex] = frozenset()  # lanes for overtaking; set by the site
        self.winds = any(bend_radius_m(lane) < math.inf for lane in lanes.values())
        self.after: dict[LaneIndex, tuple[LaneIndex, ...]] = {
            index: tuple(other for other in lanes if other[0] == index[1] and joins(lane, lanes[other]))
            for index, lane in lanes.items()
        }
        self.before: dict[LaneIndex, list[LaneIndex]] = {index: [] for index in lanes}
        for index, following in self.after.items():
            for other in following:
                self.before[other].append(index)

    def onward(self, index: LaneIndex, route: Sequence[Any] | None) -> LaneIndex | None:
        """The lane after this one: on the next road of the route, else where it goes on; None at a dead end.

        A lane that does not touch the next road of the route leads to that road's lane of the nearest number.
        """
        if not route:
            following = self.after[index]
            return following[0] if following else None
        for leg in route:
            if leg[0] == index[1]:
                following = tuple(other for other in self.after[index] if other[1] == leg[1])
                if following:
                    return following[0]
                return leg[0], leg[1], min(index[2], self.beside[leg[0], leg[1]] - 1)
        return None
