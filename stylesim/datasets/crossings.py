"""Lanes whose centre lines cross are in a junction: for maps that do not say which lanes are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, no_type_check

import numpy as np
from jaxtyping import Float64
from numba import njit

MIN_ANGLE_RAD = np.deg2rad(20.0)  # chosen: lanes that merge or split meet at less
MAX_POINTS = 30  # per lane; chosen: a lane of 100 m then has a point every 3.4 m
CLEARANCE_M = 3.0  # chosen: lanes this far above one another are a bridge; clearances are 4 m and more
_EPS = 1e-3  # a crossing this close to the end of a segment is counted with the next segment


def crossing(lines: Mapping[str, Any]) -> set[str]:
    """The ids of lines ([point, 2], or [point, 3] with heights) that cross another one at an angle, at its height."""
    thinned = {key: _thinned(np.asarray(line, np.float64)) for key, line in lines.items() if len(line) >= 2}
    if not thinned:
        return set()
    points = np.concatenate(list(thinned.values()))
    bounds = np.concatenate([[0], np.cumsum([len(line) for line in thinned.values()])])
    found = _crossed(points, bounds, float(np.sin(MIN_ANGLE_RAD)), CLEARANCE_M)
    return {key for key, crossed in zip(thinned, found, strict=True) if crossed}


def _thinned(line: Float64[np.ndarray, "point _"]) -> Float64[np.ndarray, "kept 3"]:
    at = np.unique(np.linspace(0, len(line) - 1, MAX_POINTS).round().astype(int))
    height = line[at, 2] if line.shape[1] > 2 else np.zeros(len(at))
    return np.stack([line[at, 0], line[at, 1], height], -1)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _crossed(points, bounds, sine, clearance):
    """Which lines cross another one; line i has the points (x, y, z) bounds[i] to bounds[i + 1]."""
    n = len(bounds) - 1
    crossed = np.zeros(n, np.bool_)
    low, high = np.empty((n, 2)), np.empty((n, 2))
    for i in range(n):
        for axis in range(2):
            low[i, axis] = points[bounds[i] : bounds[i + 1], axis].min()
            high[i, axis] = points[bounds[i] : bounds[i + 1], axis].max()
    for i in range(n):
        for j in range(i + 1, n):
            if crossed[i] and crossed[j]:
                continue
            if low[j, 0] > high[i, 0] or low[j, 1] > high[i, 1] or high[j, 0] < low[i, 0] or high[j, 1] < low[i, 1]:
                continue
            if _meet(points, bounds[i], bounds[i + 1] - 1, bounds[j], bounds[j + 1] - 1, sine, clearance):
                crossed[i] = crossed[j] = True
    return crossed


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _meet(points, a, a_end, b, b_end, sine, clearance):
    """Whether a segment of one line crosses a segment of the other."""
    for i in range(a, a_end):
        px, py = points[i, 0], points[i, 1]
        rx, ry = points[i + 1, 0] - px, points[i + 1, 1] - py
        for j in range(b, b_end):
            gx, gy = points[j, 0] - px, points[j, 1] - py
            sx, sy = points[j + 1, 0] - points[j, 0], points[j + 1, 1] - points[j, 1]
            cross = rx * sy - ry * sx
            t, u = (gx * sy - gy * sx) / cross, (gx * ry - gy * rx) / cross
            if not (_EPS < t < 1 - _EPS and _EPS < u < 1 - _EPS):
                continue
            apart = abs((points[i, 2] + points[i + 1, 2]) - (points[j, 2] + points[j + 1, 2])) / 2
            if apart < clearance and abs(cross) > sine * (np.hypot(rx, ry) * np.hypot(sx, sy)):
                return True
    return False
