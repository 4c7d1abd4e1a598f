"""Arithmetic on the rows of all vehicles at once: segments, directions, places further back.

Rows are ordered by vehicle, then step; a segment is an unbroken run of steps of one vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

Rows = Float64[np.ndarray, " row"]
Points = Float64[np.ndarray, "row 2"]
APART_M = 1000.0  # between segments on the common axis of `points_behind`
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


def directions(points_m: Points, segments: Segments, at_rest_rad: Rows) -> Points:
    """Unit vectors along the path at each row; while standing the last one, before the first move the first one.

    `at_rest_rad` is taken in segments that never move.
    """
    step = segments.change(points_m)
    length = np.hypot(step[:, 0], step[:, 1])
    moved = length > MOVED_M
    n = len(length)
    last = np.maximum.accumulate(np.where(moved, np.arange(n), -1))
    following = np.minimum.accumulate(np.where(moved, np.arange(n), n)[::-1])[::-1]
    ends = np.append(segments.starts[1:], n)[np.searchsorted(segments.starts, segments.first)]
    source = np.where(last >= segments.first, last, np.where(following < ends, following, -1))
    unit = step[source] / np.maximum(length[source], 1e-12)[:, None]
    rest = np.stack([np.cos(at_rest_rad), np.sin(at_rest_rad)], axis=1)
    return np.where((source >= 0)[:, None], unit, rest)


def points_behind(
    points_m: Points, unit: Points, segments: Segments, distances_m: tuple[Rows, ...]
) -> tuple[Points, ...]:
    """For each row the points of its own path that lie `distances_m` further back along it.

    Before its first row a path is continued straight backwards.
    """
    lead = max(float(distance.max(initial=0.0)) for distance in distances_m) + 1.0
    step = segments.change(points_m)
    along = np.hypot(step[:, 0], step[:, 1])
    along[segments.starts] = APART_M + lead
    arc = np.cumsum(along)
    behind = points_m[segments.starts] - lead * unit[segments.starts]
    axis = np.insert(arc, segments.starts, arc[segments.starts] - lead)
    x = np.insert(points_m[:, 0], segments.starts, behind[:, 0])
    y = np.insert(points_m[:, 1], segments.starts, behind[:, 1])
    return tuple(
        np.stack([np.interp(arc - distance, axis, x), np.interp(arc - distance, axis, y)], axis=1)
        for distance in distances_m
    )
