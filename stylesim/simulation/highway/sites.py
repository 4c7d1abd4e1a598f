"""The places that cars come to and leave: their roads, and the trips through them.

Own geometry in highway-env's terms (y to the right of a road that goes to +x; lane 0 is the leftmost).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from highway_env.road.lane import AbstractLane, LineType, SineLane, StraightLane
from highway_env.road.road import RoadNetwork

from stylesim.simulation.highway.graph import LaneGraph, LaneIndex
from stylesim.simulation.highway.lights import Programme

LANE_M = StraightLane.DEFAULT_WIDTH
RAMP_LIMIT_MPS = 100 / 3.6  # usual on the ramps between two motorways; those to main roads have 60 to 80 km/h
ASIDE_M = 6.5  # of a ramp from the lane that it joins; highway-env's merge-v0 has the same
SLIP_M = 120.0  # over which a ramp comes alongside; chosen: 1.4 m/s2 across at 25 m/s
# Chosen: the German rules (RAA) ask for 250 m of acceleration and deceleration lane.
ACCELERATION_LANE_M, DECELERATION_LANE_M = 250.0, 250.0
NONE, STRIPED, SOLID = LineType.NONE, LineType.STRIPED, LineType.CONTINUOUS_LINE

Edge = tuple[str, str]


@dataclass(frozen=True)
class Trip:
    """A way through a site, as the roads that it takes; `share` of the arrivals at its first road take it."""

    edges: tuple[Edge, ...]
    share: float = 1.0


@dataclass(frozen=True, eq=False)
class Site:
    """A place. `arrivals_per_s` by entry road; cars stand at the start as far as `filled_m` along it."""

    network: RoadNetwork
    trips: tuple[Trip, ...]
    arrivals_per_s: Mapping[Edge, float]
    filled_m: Mapping[Edge, float]
    junction_nodes: str = ""
    light: Programme | None = None  # at the end of the lanes that lead into the junction
    last_entry_s: float = 27.0  # nobody enters later than that before the end: everybody is seen for 20 s or more
    against: frozenset[LaneIndex] = frozenset()  # lanes for overtaking, which lie on the lanes of who comes
    rule: Callable[[LaneGraph], Any] | None = None  # who must wait there; `assign(cars)` sets their `waits_for_gap`


def lanes_beside(
    network: RoadNetwork, edge: Edge, along_x_m: tuple[float, float], *, lanes: int, limit_mps: float
) -> None:
    """Straight lanes side by side from y = 0 to the right, between two places along x."""
    start, end = along_x_m
    for lane in range(lanes):
        lines = (SOLID if lane == 0 else STRIPED, SOLID if lane == lanes - 1 else NONE)
        y = lane * LANE_M
        network.add_lane(*edge, StraightLane([start, y], [end, y], line_types=lines, speed_limit=limit_mps))


def _slip(start: tuple[float, float], end: tuple[float, float], limit_mps: float) -> AbstractLane:
    """Half a cosine from one place to the other, both ends along x."""
    middle, half = (start[1] + end[1]) / 2, (start[1] - end[1]) / 2
    length = end[0] - start[0]
    return SineLane(
        [start[0], middle],
        [end[0], middle],
        half,
        math.pi / length,
        math.pi / 2,
        line_types=[SOLID, SOLID],
        speed_limit=limit_mps,
    )


def merge_site(drawn: Mapping[str, float]) -> Site:
    """A motorway with an on-ramp: 700 m, 250 m of acceleration lane, and on to 4,000 m."""
    lanes, limit = round(drawn["lanes"]), drawn["speed_limit_mps"]
    joint, end, out = 700.0, 700.0 + ACCELERATION_LANE_M, 4000.0
    y = lanes * LANE_M
    network = RoadNetwork()
    lanes_beside(network, ("in", "joint"), (0.0, joint), lanes=lanes, limit_mps=limit)
    lanes_beside(network, ("joint", "end"), (joint, end), lanes=lanes + 1, limit_mps=limit)
    lanes_beside(network, ("end", "out"), (end, out), lanes=lanes, limit_mps=limit)
    before = joint - SLIP_M
    ramp = StraightLane(
        [before - 280.0, y + ASIDE_M], [before, y + ASIDE_M], line_types=(SOLID, SOLID), speed_limit=RAMP_LIMIT_MPS
    )
    network.add_lane("ramp", "slip", ramp)
    network.add_lane("slip", "joint", _slip((before, y + ASIDE_M), (joint, y), RAMP_LIMIT_MPS))
    through = (("in", "joint"), ("joint", "end"), ("end", "out"))
    entering = (("ramp", "slip"), ("slip", "joint"), ("joint", "end"), ("end", "out"))
    flow = drawn["density_per_km_lane"] / 1000.0 * limit * lanes
    share = drawn["ramp_share"]
    return Site(
        network,
        (Trip(through), Trip(entering)),
        arrivals_per_s={("in", "joint"): flow * (1 - share), ("ramp", "slip"): flow * share},
        filled_m={("in", "joint"): 1800.0, ("ramp", "slip"): 250.0},
        last_entry_s=45.0,
    )


def exit_site(drawn: Mapping[str, float]) -> Site:
    """A motorway with an off-ramp: 2,500 m, 250 m of deceleration lane, and on to 4,000 m, or down the ramp."""
    lanes, limit = round(drawn["lanes"]), drawn["speed_limit_mps"]
    begin, fork, out = 2500.0, 2500.0 + DECELERATION_LANE_M, 4000.0
    y = lanes * LANE_M
    network = RoadNetwork()
    lanes_beside(network, ("in", "begin"), (0.0, begin), lanes=lanes, limit_mps=limit)
    lanes_beside(network, ("begin", "fork"), (begin, fork), lanes=lanes + 1, limit_mps=limit)
    lanes_beside(network, ("fork", "out"), (fork, out), lanes=lanes, limit_mps=limit)
    beyond = fork + SLIP_M
    network.add_lane("fork", "slip", _slip((fork, y), (beyond, y + ASIDE_M), RAMP_LIMIT_MPS))
    ramp = StraightLane(
        [beyond, y + ASIDE_M], [out - 100.0, y + ASIDE_M], line_types=(SOLID, SOLID), speed_limit=RAMP_LIMIT_MPS
    )
    network.add_lane("slip", "ramp", ramp)
    share = drawn["exit_share"]
    through = (("in", "begin"), ("begin", "fork"), ("fork", "out"))
    leaving = (("in", "begin"), ("begin", "fork"), ("fork", "slip"), ("slip", "ramp"))
    flow = drawn["density_per_km_lane"] / 1000.0 * limit * lanes
    return Site(
        network,
        (Trip(through, 1 - share), Trip(leaving, share)),
        arrivals_per_s={("in", "begin"): flow},
        filled_m={("in", "begin"): 1800.0},
        last_entry_s=45.0,
    )
