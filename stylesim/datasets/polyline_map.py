"""Maps made of polylines with ids (Waymo Open Motion and what was converted from it) into a `Road`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from stylesim.datasets.boundaries import Boundary, Stretch, boundaries
from stylesim.datasets.crossings import crossing
from stylesim.datasets.polylines import map_line, map_lines, stop_line_at
from stylesim.geometry import wrap_angle
from stylesim.road import Lane, Road

MPH = 0.44704  # m/s, by definition
# Chosen: where a format has no links, lanes whose ends meet this closely, in this direction, follow one another.
MEETING_M, MEETING_RAD = 0.5, np.deg2rad(30.0)


@dataclass(frozen=True, eq=False)
class PolylineLane:
    """One lane as such a map has it."""

    lane_id: str
    points: Any  # [point, 2], or 3 with heights, in the source's frame
    speed_limit_mps: float = float("nan")
    successors: Sequence[str] = ()
    left_boundaries: Sequence[Stretch] = ()
    right_boundaries: Sequence[Stretch] = ()
    left_neighbours: Sequence[Stretch] = ()
    right_neighbours: Sequence[Stretch] = ()
    in_junction: bool = False


@dataclass(eq=False)
class PolylineMap:
    """The features of one scene's map, in the source's frame."""

    lanes: list[PolylineLane] = field(default_factory=list)
    lines: dict[str, Any] = field(default_factory=dict)  # road lines and edges, by id
    crosswalks: list[Any] = field(default_factory=list)
    stops: dict[str, Any] = field(default_factory=dict)  # where the light of a lane makes it stop, by lane


def road_of(features: PolylineMap, origin_m: Float64[np.ndarray, " 2"], *, link_ends: bool = False) -> Road:
    """The road in metres from `origin_m`. `link_ends`: successors follow from ends that meet.

    Where no lane is marked as in a junction, those are that cross another one. Lanes of less than two points are
    left out. ValueError where a point is damaged.
    """
    lines = dict(zip(features.lines, map_lines([*features.lines.values()], origin_m), strict=True))
    given = zip(features.lanes, map_lines([lane.points for lane in features.lanes], origin_m), strict=True)
    centres = {lane.lane_id: line for lane, line in given if len(line) >= 2}
    follows = meeting(centres) if link_ends else {}
    marked = {lane.lane_id for lane in features.lanes if lane.in_junction}
    junction = marked or crossing({lane.lane_id: lane.points for lane in features.lanes if lane.lane_id in centres})
    drawn = [lane for lane in features.lanes if lane.lane_id in centres]
    raw = [np.asarray(lane.points, np.float64)[:, :2] - origin_m for lane in drawn]
    left = boundaries(raw, [lane.left_boundaries for lane in drawn], lines)
    right = boundaries(raw, [lane.right_boundaries for lane in drawn], lines)
    lanes = []
    for lane, sides in zip(drawn, zip(left, right, strict=True), strict=True):
        links = follows.get(lane.lane_id, ()) if link_ends else lane.successors
        successors = tuple(dict.fromkeys(s for s in links if s in centres))
        stop = features.stops.get(lane.lane_id)
        lanes.append(_lane(lane, centres, sides, successors, stop, origin_m, in_junction=lane.lane_id in junction))
    walks = tuple(walk for walk in map_lines(features.crosswalks, origin_m) if len(walk) >= 3)
    return Road(lanes=tuple(lanes), source="map", crosswalks_m=walks)


def _lane(
    lane: PolylineLane,
    centres: Mapping[str, Float32[np.ndarray, "_ 2"]],
    sides: tuple[Boundary, Boundary],
    successors: tuple[str, ...],
    stop: Any,
    origin_m: Float64[np.ndarray, " 2"],
    *,
    in_junction: bool,
) -> Lane:
    centre = centres[lane.lane_id]
    (left, left_m), (right, right_m) = sides
    width = left_m + right_m
    point = None if stop is None else map_line(np.asarray(stop, np.float64)[None], origin_m)[0]
    limit = lane.speed_limit_mps
    return Lane(
        lane_id=lane.lane_id,
        centre_line_m=centre,
        width_m=width,
        speed_limit_mps=limit if 0 < limit < 60 else float("nan"),  # 0 stands for unknown; 60 m/s is 216 km/h
        left_boundary_m=left,
        right_boundary_m=right,
        successors=successors,
        left_neighbour=_longest(lane.left_neighbours, centres),
        right_neighbour=_longest(lane.right_neighbours, centres),
        in_junction=in_junction,
        stop_line_m=None if point is None else stop_line_at(point, centre, width),
    )


def _longest(stretches: Sequence[Stretch], centres: Mapping[str, Any]) -> str:
    """The neighbour along the longest stretch; "" where there is none in the map."""
    known = [s for s in stretches if s[0] in centres]
    return max(known, key=lambda s: s[2] - s[1])[0] if known else ""


def meeting(centres: Mapping[str, Float32[np.ndarray, "_ 2"]]) -> dict[str, tuple[str, ...]]:
    """For each lane those that begin where it ends, and go on in its direction."""
    ids = list(centres)
    if not ids:
        return {}
    first, last = np.stack([centres[i][0] for i in ids]), np.stack([centres[i][-1] for i in ids])
    out = np.stack([centres[i][-1] - centres[i][-2] for i in ids])
    into = np.stack([centres[i][1] - centres[i][0] for i in ids])
    turn = wrap_angle(np.arctan2(into[:, 1], into[:, 0])[None] - np.arctan2(out[:, 1], out[:, 0])[:, None])
    gap = np.hypot(*np.moveaxis(last[:, None] - first[None], -1, 0))
    follows = (gap <= MEETING_M) & (np.abs(turn) <= MEETING_RAD)
    np.fill_diagonal(follows, False)
    return {ids[i]: tuple(ids[j] for j in np.flatnonzero(row)) for i, row in enumerate(follows)}
