"""A roundabout of one lane with four arms, and the rule that the ring goes first.

Own geometry: the arcs of entry and exit touch both the straight arm and the ring, so that nobody turns on the spot.
With the ring's radius R, the arc's r and half the distance d of the two lanes of an arm the arc's centre lies at
(d + r, sqrt((R + r)^2 - (d + r)^2)) from the middle, seen along the arm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from highway_env.road.lane import CircularLane, StraightLane
from highway_env.road.road import RoadNetwork

from stylesim.simulation.highway.graph import LaneGraph
from stylesim.simulation.highway.right_of_way import CREEP_MPS, OVER_LINE_M, RightOfWay
from stylesim.simulation.highway.sites import LANE_M, SOLID, Edge, Site, Trip

RING_M, ARC_M, ARM_M = 20.0, 15.0, 150.0  # chosen: compact roundabouts have outer diameters of 26 to 40 m (FGSV)
ARMS = ("s", "e", "n", "w")  # in the order in which the ring passes them
FROM_REST_MPS, IN_ARC_MPS = 4.0, 6.5  # on average over the arc onto the ring: who starts there, who comes moving
SPARE_S = 1.0  # chosen: who enters is on the ring that long before who comes
TURNS = {1: 0.3, 2: 0.5, 3: 0.2}  # arms further on; chosen, because half of the traffic goes straight on


def _rotated(x: float, y: float, quarter: int) -> list[float]:
    """A place of the southern arm's, on the arm that comes `quarter` quarters later."""
    for _ in range(quarter):
        x, y = y, -x
    return [x, y]


def _edges(a: str) -> dict[str, Edge]:
    return {
        "approach": (f"o{a}", f"i{a}0"),
        "enter": (f"i{a}0", f"i{a}e"),
        "leave": (f"i{a}x", f"i{a}1"),
        "depart": (f"i{a}1", f"d{a}"),
    }


def roundabout_site(drawn: Mapping[str, float]) -> Site:
    """The roundabout with equal demand on its arms."""
    limit, d = drawn["speed_limit_mps"], LANE_M / 2
    far = math.sqrt((RING_M + ARC_M) ** 2 - (d + ARC_M) ** 2)
    touch = math.atan2(far, d + ARC_M)  # angle of the place where the entry of the southern arm meets the ring
    network = RoadNetwork()
    lines = (SOLID, SOLID)

    def straight(edge: Edge, start: list[float], end: list[float]) -> None:
        network.add_lane(*edge, StraightLane(start, end, line_types=lines, speed_limit=limit))

    def arc(edge: Edge, centre: list[float], radius: float, phases: tuple[float, float], *, clockwise: bool) -> None:
        lane = CircularLane(centre, radius, *phases, clockwise=clockwise, line_types=lines, speed_limit=limit)
        network.add_lane(*edge, lane)

    for quarter, a in enumerate(ARMS):
        b, turned, edges = ARMS[(quarter + 1) % 4], -quarter * math.pi / 2, _edges(a)
        straight(edges["approach"], _rotated(d, far + ARM_M, quarter), _rotated(d, far, quarter))
        arc(
            edges["enter"], _rotated(d + ARC_M, far, quarter), ARC_M,
            (math.pi + turned, math.pi + touch + turned), clockwise=True,
        )  # fmt: skip
        arc(edges["leave"], _rotated(-d - ARC_M, far, quarter), ARC_M, (turned - touch, turned), clockwise=True)
        straight(edges["depart"], _rotated(-d, far, quarter), _rotated(-d, far + ARM_M, quarter))
        arc((f"i{a}x", f"i{a}e"), [0.0, 0.0], RING_M, (math.pi - touch + turned, touch + turned), clockwise=False)
        following = math.pi - touch + turned - math.pi / 2
        arc((f"i{a}e", f"i{b}x"), [0.0, 0.0], RING_M, (touch + turned, following), clockwise=False)
    entries = {_edges(a)["approach"]: drawn["demand_vph"] / 3600.0 / 4 for a in ARMS}
    return Site(
        network,
        tuple(_trip(start, turn) for start in range(4) for turn in TURNS),
        arrivals_per_s=entries,
        filled_m=dict.fromkeys(entries, 120.0),
        junction_nodes="i",
        rule=RingRule,
    )


def _trip(start: int, turn: int) -> Trip:
    """From one arm to the one `turn` arms further on."""
    names = [ARMS[(start + n) % 4] for n in range(turn + 1)]
    first, last = _edges(names[0]), _edges(names[-1])
    edges = [first["approach"], first["enter"]]
    for here, following in pairwise(names):
        edges.append((f"i{here}e", f"i{following}x"))
        if following != names[-1]:
            edges.append((f"i{following}x", f"i{following}e"))
    return Trip((*edges, last["leave"], last["depart"]), TURNS[turn])


class RingRule(RightOfWay):
    """Who enters waits for a gap on the ring as long as its style wants, and as it takes to get there.

    Who will leave before is no obstacle.
    """

    def __init__(self, graph: LaneGraph) -> None:
        self._length_m = graph.length_m

    def assign(self, vehicles: Iterable[Any]) -> None:
        """Set `waits_for_gap` of every car."""
        cars = list(vehicles)
        circling = [car for car in cars if self._on_ring(car.target_lane_index[:2])]
        for car in cars:
            waited, car.waits_for_gap = car.waits_for_gap, False
            start, end, _ = car.target_lane_index
            if car.style is None or not (start.startswith("o") and end.endswith("0")):
                continue
            distance = self._length_m[car.target_lane_index] - car.road.place(car, car.target_lane_index)[0]
            distance -= car.LENGTH / 2
            waits_on = waited and distance >= -OVER_LINE_M  # who comes to rest at the line has not gone yet
            if waits_on or self._looks(car, car.style, distance):
                entry = f"{end[:-1]}e"
                on_arc = distance + self._length_m[end, entry, 0]
                pace = min(max(car.speed, FROM_REST_MPS), IN_ARC_MPS)
                needed_s = max(car.style.gap_acceptance_s, on_arc / pace + SPARE_S)
                car.waits_for_gap = any(
                    self._seconds_to(other, entry) < needed_s for other in circling if other is not car
                )

    @staticmethod
    def _on_ring(edge: Edge) -> bool:
        """Its arcs, and the arcs onto it: who has begun to enter is in the way already."""
        return (edge[0][-1] in "ex" and edge[1][-1] in "ex") or (edge[0].startswith("i") and edge[1].endswith("e"))

    def _seconds_to(self, other: Any, entry: str) -> float:
        """Time until a car on the ring is where an arm enters; infinite if it leaves before or has passed."""
        index = other.target_lane_index
        metres = self._length_m[index] - other.road.place(other, index)[0]
        for _ in range(2 * len(ARMS)):
            if index[1] == entry:
                return float(np.maximum(metres, 0.0) / max(other.speed, CREEP_MPS))
            onward = other.road.graph.onward(index, other.route)
            if onward is None or not self._on_ring(onward[:2]):
                return math.inf
            index = onward
            metres += self._length_m[index]
        return math.inf
