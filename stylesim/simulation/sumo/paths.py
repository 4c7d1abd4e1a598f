"""Arithmetic on the rows of all vehicles at once: segments, directions, places further back.

Rows are ordered by vehicle, then step; a segment is an unbroken run of steps of one vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

Rows = Float64[np.ndarray, " row"]
Points = Float64[np.ndarray, "row 2"]
MOVED_M = 0.01  # a step shorter than this (0.1 m/s) has no direction of its own


@dataclass(frozen=True, eq=False)
class Segments:
    """Where each row's segment begins."""

    first: Int64[np.ndarray, " row"]  # index of the first row of its segment
    starts: Int64[np.ndarray, " segment"]

    @classmethod
    def of(cls, driver: Int32[np.ndarray, " row"], step: Int32[np.ndarray, " row"]) -> Segments:
        """The segments of rows ordered by driver and step."""
        new = np.ones(len(driver), bool)
        new[1:] = (np.diff(driver) != 0) | (np.diff(step) != 1)
        starts = np.flatnonzero(new)
        lengths = np.diff(np.append(starts, len(driver)))
        return cls(np.repeat(starts, lengths), starts)

    def is_first(self) -> Bool[np.ndarray, " row"]:
        """True for the first row of each segment."""
        return np.asarray(self.first == np.arange(len(self.first)))

    def change(self, values: Rows | Points) -> Rows | Points:
        """The difference to the row before; 0 in the first row of a segment."""
        result = np.zeros_like(values)
        result[1:] = values[1:] - values[:-1]
        result[self.starts] = 0.0
        return result

    def slices(self) -> Iterator[slice]:
        """The rows of each segment."""
        if not len(self.starts):
            return
        ends = np.append(self.starts[1:], len(self.first))
        for start, end in zip(self.starts.tolist(), ends.tolist(), strict=True):
            yield slice(start, end)

    def total(self, values: Rows | Points) -> Rows | Points:
        """The sum of the rows of its segment up to each row.

        Segment by segment, because a sum over all of them would round one vehicle's path by what others do.
        """
        result = np.empty_like(values)
        for rows in self.slices():
            np.cumsum(values[rows], axis=0, out=result[rows])
        return result


def directions(points_m: Points, segments: Segments, at_rest_rad: Rows) -> Points:
    """Unit vectors along the path at each row; while standing the last one, before the first move `at_rest_rad`.

    Nothing later than a row decides its direction.
    """
    step = segments.change(points_m)
    length = np.hypot(step[:, 0], step[:, 1])
    moved = length > MOVED_M
    last = np.maximum.accumulate(np.where(moved, np.arange(len(length)), -1))
    source = np.where(last >= segments.first, last, -1)
    unit = step[source] / np.maximum(length[source], 1e-12)[:, None]
    rest = np.stack([np.cos(at_rest_rad), np.sin(at_rest_rad)], axis=1)
    return np.where((source >= 0)[:, None], unit, rest)


def points_behind(
    points_m: Points, unit: Points, segments: Segments, distances_m: tuple[Rows, ...]
) -> tuple[Points, ...]:
    """For each row the points of its own path that lie `distances_m` further back along it.

    Before its first row a path is continued straight backwards.
    """
    step = segments.change(points_m)
    arc = segments.total(np.hypot(step[:, 0], step[:, 1]))
    results = tuple(np.empty_like(points_m) for _ in distances_m)
    for rows in segments.slices():
        lead = max(float(distance[rows.start]) for distance in distances_m) + 1.0  # a body does not change its length
        behind = points_m[rows.start] - lead * unit[rows.start]
        axis = np.concatenate([[arc[rows.start] - lead], arc[rows]])
        for dimension in (0, 1):
            values = np.concatenate([[behind[dimension]], points_m[rows, dimension]])
            for result, distance in zip(results, distances_m, strict=True):
                result[rows, dimension] = np.interp(arc[rows] - distance[rows], axis, values)
    return results
