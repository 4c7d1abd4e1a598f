"""Maps made of polylines with ids (Waymo Open Motion and what was converted from it) into a `Road`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from stylesim.datasets.crossings import crossing
from stylesim.datasets.polylines import map_line, nearest_points, stop_line_at
from stylesim.geometry import wrap_angle
from stylesim.road import Lane, Road

MPH = 0.44704  # m/s, by definition
MAX_HALF_WIDTH_M = 5.0  # chosen: a boundary farther from the centre is not that of this lane
# Chosen: where a format has no links, lanes whose ends meet this closely, in this direction, follow one another.
MEETING_M, MEETING_RAD = 0.5, np.deg2rad(30.0)

Stretch = tuple[str, int, int]  # id of a feature, and from which to which point of the lane it is beside it


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
    lines = {key: map_line(points, origin_m) for key, points in features.lines.items()}
    centres = {lane.lane_id: map_line(lane.points, origin_m) for lane in features.lanes}
    centres = {key: line for key, line in centres.items() if len(line) >= 2}
    follows = meeting(centres) if link_ends else {}
    marked = {lane.lane_id for lane in features.lanes if lane.in_junction}
    junction = marked or crossing({lane.lane_id: lane.points for lane in features.lanes if lane.lane_id in centres})
    lanes = []
    for lane in features.lanes:
        if lane.lane_id in centres:
            links = follows.get(lane.lane_id, ()) if link_ends else lane.successors
            successors = tuple(dict.fromkeys(s for s in links if s in centres))
            stop = features.stops.get(lane.lane_id)
            made = _lane(lane, centres, lines, successors, stop, origin_m)
            lanes.append(replace(made, in_junction=lane.lane_id in junction))
    walks = tuple(walk for walk in (map_line(c, origin_m) for c in features.crosswalks) if len(walk) >= 3)
    return Road(lanes=tuple(lanes), source="map", crosswalks_m=walks)


def _lane(
    lane: PolylineLane,
    centres: Mapping[str, Float32[np.ndarray, "_ 2"]],
    lines: Mapping[str, Float32[np.ndarray, "_ 2"]],
    successors: tuple[str, ...],
    stop: Any,
    origin_m: Float64[np.ndarray, " 2"],
) -> Lane:
    centre = centres[lane.lane_id]
    raw = np.asarray(lane.points, np.float64)[:, :2] - origin_m
    left, left_m = _boundary(raw, lane.left_boundaries, lines)
    right, right_m = _boundary(raw, lane.right_boundaries, lines)
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
        stop_line_m=None if point is None else stop_line_at(point, centre, width),
    )


def _boundary(
    centre_m: Float64[np.ndarray, "point 2"],
    stretches: Sequence[Stretch],
    lines: Mapping[str, Float32[np.ndarray, "_ 2"]],
) -> tuple[Float32[np.ndarray, "boundary 2"] | None, float]:
    """The points of the boundary abreast of the lane's own, and the median distance to them (NaN where none)."""
    found: list[Float64[np.ndarray, "place 2"]] = []
    distances: list[Float64[np.ndarray, " place"]] = []
    for feature, start, end in sorted(stretches, key=lambda s: s[1]):
        line = lines.get(feature)
        places = centre_m[max(start, 0) : end + 1]
        if line is None or len(line) < 2 or not len(places):
            continue
        line = _stretch_near(places, line)
        if len(line) < 2:
            continue
        feet = nearest_points(places, line)
        apart = np.hypot(*(feet - places).T)
        near = apart <= MAX_HALF_WIDTH_M
        found.append(feet[near])
        distances.append(apart[near])
    if not found or sum(map(len, found)) < 2:
        return None, float("nan")
    return map_line(np.concatenate(found), np.zeros(2)), float(np.median(np.concatenate(distances)))


def _stretch_near(
    places_m: Float64[np.ndarray, "place 2"], line_m: Float32[np.ndarray, "point 2"]
) -> Float32[np.ndarray, "near 2"]:
    """The stretch of a line outside of which no point is within MAX_HALF_WIDTH_M of any place: boundaries are long."""
    reach = MAX_HALF_WIDTH_M + float(np.hypot(*np.diff(line_m, axis=0).T).max())
    low, high = places_m.min(axis=0) - reach, places_m.max(axis=0) + reach
    inside = np.flatnonzero(((line_m >= low) & (line_m <= high)).all(axis=1))
    return line_m[max(inside[0] - 1, 0) : inside[-1] + 2] if len(inside) else line_m[:0]


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
