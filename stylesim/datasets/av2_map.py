"""The vector map of an Argoverse 2 scenario: `log_map_archive_<id>.json`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64, Int64

from stylesim.datasets.av2_map_file import LaneSegment, Point, map_file
from stylesim.datasets.guarding import reading
from stylesim.datasets.polylines import MAX_MAP_M
from stylesim.road import Lane, Road

# Lanes for motor traffic [read: the lane types of the format are VEHICLE, BUS, BIKE]. A bicycle lane would be
# the nearest "lane" of many a car beside it.
DRIVABLE = ("VEHICLE", "BUS")
_X, _Y = attrgetter("x"), attrgetter("y")
BOUNDARY_POINTS = 20  # chosen: lane segments are 10 to 60 m long, so the centre has a point every 0.5 to 3 m


def read_map(path: Path, origin_m: Float64[np.ndarray, " 2"]) -> Road:
    """The lanes and crosswalks of a map file, in metres from `origin_m`.

    Centre lines are the file's own where it gives them, else the middle of the boundaries. Ids of successors and
    neighbours outside the map are left out. InputError where the file is damaged or no such map.
    """
    with reading(path, "Argoverse 2 map"):
        content = map_file(path)
        segments = [s for s in content.lane_segments.values() if s.lane_type in DRIVABLE]
        crossings = list(content.pedestrian_crossings.values())
        sides = [side for s in segments for side in (s.left_lane_boundary, s.right_lane_boundary)]
        edges = [edge for crossing in crossings for edge in (crossing.edge1, crossing.edge2)]
        given = [s.centerline for s in segments if s.centerline]
        lines = _Lines.of([*sides, *edges, *given], origin_m)
        even = lines.even(len(sides)).reshape(-1, 2, BOUNDARY_POINTS, 2)
        middle = even.mean(axis=1).astype(np.float32)
        middle.flags.writeable = False
        width = np.median(np.hypot(*np.moveaxis(even[:, 0] - even[:, 1], -1, 0)), axis=-1)
        centre = iter(range(len(sides) + len(edges), len(lines.start)))
        known = {str(s.id) for s in segments}
        lanes = tuple(
            _lane(
                segment,
                known,
                (lines.line(2 * i), lines.line(2 * i + 1)),
                lines.line(next(centre)) if segment.centerline else middle[i],
                float(width[i]),
            )
            for i, segment in enumerate(segments)
        )
        first = len(sides)
        walks = tuple(
            np.concatenate([lines.line(first + 2 * i), lines.line(first + 2 * i + 1)[::-1]])
            for i in range(len(crossings))
        )
        return Road(lanes=lanes, source="map", crosswalks_m=walks)


@dataclass(frozen=True, eq=False)
class _Lines:
    """All lines of a map in one array: a map has hundreds, of a few points each."""

    points_m: Float64[np.ndarray, "point 2"]
    stored_m: Float32[np.ndarray, "point 2"]  # read-only, so that the lanes share it
    start: Int64[np.ndarray, " line"]  # of each line, and the end of the last

    @classmethod
    def of(cls, lines: Sequence[Sequence[Point]], origin_m: Float64[np.ndarray, " 2"]) -> _Lines:
        """Lines in metres from `origin_m`; repeated points are left out. ValueError as `polylines.map_line`."""
        owner = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
        every = [point for line in lines for point in line]
        points = np.empty((len(every), 2))
        for axis, of in enumerate((_X, _Y)):
            points[:, axis] = np.fromiter(map(of, every), np.float64, len(every))
        points -= origin_m
        if not (np.abs(points) <= MAX_MAP_M).all():  # not-a-number fails too
            raise ValueError("a point of the map is not finite or too far away")
        apart = np.ones(len(points), bool)
        apart[1:] = (np.hypot(*np.diff(points, axis=0).T) > 1e-6) | (owner[1:] != owner[:-1])
        start = np.searchsorted(owner[apart], np.arange(len(lines) + 1))
        if (np.diff(start) < 2).any():
            raise ValueError("a line has less than two points")
        kept = points[apart]
        stored = kept.astype(np.float32)
        stored.flags.writeable = False
        return cls(kept, stored, start.astype(np.int64))

    def line(self, number: int) -> Float32[np.ndarray, "point 2"]:
        """One of the lines."""
        return self.stored_m[self.start[number] : self.start[number + 1]]

    def even(self, n: int) -> Float64[np.ndarray, "line sample 2"]:
        """BOUNDARY_POINTS points at equal distances along each of the first `n` lines, ends included."""
        points, start = self.points_m[: self.start[n]], self.start[: n + 1]
        step = np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T)
        step[start[:-1]] = 1.0  # lines lie one behind the other on one axis
        along = np.cumsum(step)
        first, last = along[start[:-1]], along[start[1:] - 1]
        at = first[:, None] + np.linspace(0.0, 1.0, BOUNDARY_POINTS) * (last - first)[:, None]
        return np.stack([np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])], -1)


def _lane(
    segment: LaneSegment,
    known: set[str],
    sides_m: tuple[Float32[np.ndarray, "l 2"], Float32[np.ndarray, "r 2"]],
    centre_m: Float32[np.ndarray, "point 2"],
    width_m: float,
) -> Lane:
    return Lane(
        lane_id=str(segment.id),
        centre_line_m=centre_m,
        width_m=width_m,
        left_boundary_m=sides_m[0],
        right_boundary_m=sides_m[1],
        successors=tuple(lane for lane in map(str, segment.successors) if lane in known),
        left_neighbour=_neighbour(segment.left_neighbor_id, known),
        right_neighbour=_neighbour(segment.right_neighbor_id, known),
        in_junction=segment.is_intersection,
    )


def _neighbour(lane_id: int | str | None, known: set[str]) -> str:
    return str(lane_id) if lane_id is not None and str(lane_id) in known else ""
