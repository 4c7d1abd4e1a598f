"""Polylines of foreign maps: checked, without repeated points, in metres from a scene's origin."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from stylesim.geometry import project

# Chosen: no map of these formats reaches farther than a city; a point beyond is damaged, or in other units.
MAX_MAP_M = 100_000.0
NOMINAL_WIDTH_M = 3.5  # chosen, common lane width: only for the length of a stop line that is given as a point


def map_line(points: Any, origin_m: Float64[np.ndarray, " 2"]) -> Float32[np.ndarray, "point 2"]:
    """The first two coordinates of `points` ([point, 2 or 3], in the source's frame), repeated points left out.

    ValueError where a point is not finite or too far away.
    """
    return map_lines([points], origin_m)[0]


def map_lines(lines: Sequence[Any], origin_m: Float64[np.ndarray, " 2"]) -> list[Float32[np.ndarray, "_ 2"]]:
    """`map_line` of each: a map has hundreds of lines of a few points, so they are checked in one array."""
    arrays = [np.asarray(points, np.float64) for points in lines]
    for array in arrays:
        if array.ndim != 2 or array.shape[1] < 2:
            raise ValueError(f"a line has the shape {array.shape}, not (points, 2 or 3)")
    if not arrays:
        return []
    every = np.concatenate([array[:, :2] for array in arrays]) - origin_m
    if not (np.abs(every) <= MAX_MAP_M).all():  # not-a-number fails too
        raise ValueError("a point of the map is not finite or too far away")
    return distinct_points(every, np.repeat(np.arange(len(arrays)), [len(array) for array in arrays]), len(arrays))


def distinct_points(
    points_m: Float64[np.ndarray, "point 2"], line: Int64[np.ndarray, " point"], n_lines: int
) -> list[Float32[np.ndarray, "_ 2"]]:
    """The points of each line, repeated ones left out, as read-only arrays; `line` says whose a point is, ascending."""
    apart = np.ones(len(points_m), bool)
    step = np.diff(points_m, axis=0)
    apart[1:] = (np.hypot(step[:, 0], step[:, 1]) > 1e-6) | (line[1:] != line[:-1])
    kept = points_m[apart].astype(np.float32)
    kept.flags.writeable = False
    bounds = np.searchsorted(line[apart], np.arange(n_lines + 1)).tolist()
    return [kept[a:b] for a, b in pairwise(bounds)]


def stop_line_at(
    point_m: Float[np.ndarray, " 2"], line_m: Float32[np.ndarray, "point 2"], width_m: float
) -> Float64[np.ndarray, "2 2"]:
    """A line across the lane through the foot of `point_m` on its centre line, from its right to its left."""
    _, _, _, segment = project(point_m[None].astype(np.float64), line_m)
    at = int(segment[0])
    start = line_m[at].astype(np.float64)
    direction = line_m[at + 1] - start
    direction /= max(float(np.hypot(*direction)), 1e-9)
    foot = start + float((point_m - start) @ direction) * direction
    left = np.array([-direction[1], direction[0]]) * (width_m if width_m > 0 else NOMINAL_WIDTH_M) / 2
    return np.stack([foot - left, foot + left])


def nearest_points(
    places_m: Float64[np.ndarray, "place 2"], line_m: Float32[np.ndarray, "point 2"]
) -> Float64[np.ndarray, "place 2"]:
    """The foot of each place on a line."""
    line = line_m.astype(np.float64)
    along, _, _, segment = project(places_m, line_m)
    step = np.diff(line, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    start = np.concatenate([[0.0], np.cumsum(length)])[segment]
    share = (along - start) / np.maximum(length[segment], 1e-12)
    return line[segment] + share[:, None] * step[segment]
