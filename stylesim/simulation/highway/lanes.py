"""highway-env's road network as our `Road`.

highway-env's y axis points down (it is drawn so) and its angles turn clockwise. Our frame is right-handed, so
y and every angle change sign; then left is left, and lane i + 1 is the right neighbour of lane i.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import numpy as np
from highway_env.road.lane import SineLane, StraightLane
from highway_env.road.road import RoadNetwork
from jaxtyping import Float

from stylesim.road import Lane, Road
from stylesim.simulation.highway.graph import LaneGraph, LaneIndex

STRAIGHT_M = 20.0  # spacing of centre line points: straights
CURVED_M = 1.0  # and everything else; the error on a curve of radius 9 m is then 1.4 cm


def lane_id(index: tuple[str, str, int]) -> str:
    """The id of a lane in our road: its two nodes and its number from the left."""
    return f"{index[0]}-{index[1]}-{index[2]}"


def flipped(points: Float[np.ndarray, "*any 2"]) -> Float[np.ndarray, "*any 2"]:
    """highway-env's coordinates (y down) in our frame (y up), and back."""
    return points * np.array([1.0, -1.0])


def _side(lane: Any, along: Float[np.ndarray, " point"], share: float) -> Float[np.ndarray, "point 2"]:
    """Points at `share` of the width to the right of the centre line."""
    return flipped(np.array([lane.position(s, share * lane.width_at(s)) for s in along]))


def road_of(network: RoadNetwork, *, junction_nodes: str = "", against: Collection[LaneIndex] = ()) -> Road:
    """Every lane of the network; a lane whose nodes both start with `junction_nodes` lies inside the junction.

    Lanes that lead into the junction get a stop line at their end. Lanes `against` the oncoming traffic are left out,
    because they are the other direction's.
    """
    lanes, graph = [], LaneGraph(network)
    for index, lane in network.lanes_dict().items():
        if index in against:
            continue
        start, end, number = index
        spacing = STRAIGHT_M if isinstance(lane, StraightLane) and not isinstance(lane, SineLane) else CURVED_M
        along = np.linspace(0.0, lane.length, max(2, math.ceil(lane.length / spacing) + 1))
        inside = bool(junction_nodes) and start.startswith(junction_nodes) and end.startswith(junction_nodes)
        beside = len(network.graph[start][end])
        left, right = _side(lane, along, -0.5), _side(lane, along, 0.5)
        enters = bool(junction_nodes) and not inside and end.startswith(junction_nodes)
        lanes.append(
            Lane(
                lane_id(index),
                _side(lane, along, 0.0),
                width_m=float(lane.width_at(0.0)),
                speed_limit_mps=float(lane.speed_limit),
                left_boundary_m=left,
                right_boundary_m=right,
                successors=tuple(lane_id(other) for other in graph.after[index]),
                left_neighbour=lane_id((start, end, number - 1))
                if number > 0 and (start, end, number - 1) not in against
                else "",
                right_neighbour=lane_id((start, end, number + 1)) if number + 1 < beside else "",
                in_junction=inside,
                stop_line_m=np.stack([left[-1], right[-1]]) if enters else None,
            )
        )
    return Road(tuple(lanes))
