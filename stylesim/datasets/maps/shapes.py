"""Lane geometry that map formats share: two boundaries in order, the line between them, lanes that cross."""

from __future__ import annotations

from collections.abc import Sequence
from typing import no_type_check

import numpy as np
from jaxtyping import Bool, Float64
from numba import njit

from stylesim.geometry import arc_length

STATION_M = 1.0  # chosen: at a turning radius of 8 m the chord is 2 cm off the arc
MAX_STATIONS = 2000  # chosen: bounds what a damaged file can ask for; 2 km of one lane are still every metre
MIN_CROSSING_RAD = np.deg2rad(15.0)  # chosen: lanes that merge or split do so at less, lanes that cross at more
SAME_POINT_M = 1e-3
_ENDS = 0.02  # chosen: 2 % of a line's length are its ends


def distinct(line_m: Float64[np.ndarray, "point 2"]) -> Float64[np.ndarray, "kept 2"]:
    """The line without points that repeat the one before. ValueError where fewer than two or no number is left."""
    if len(line_m) < 2 or not np.isfinite(line_m).all():
        raise ValueError("a line needs two or more finite points")
    apart = np.concatenate([[True], np.hypot(*np.diff(line_m, axis=0).T) > SAME_POINT_M])
    kept = line_m[apart]
    if len(kept) < 2:
        raise ValueError("all points of a line are one place")
    return kept


def aligned(
    left_m: Float64[np.ndarray, "left 2"], right_m: Float64[np.ndarray, "right 2"]
) -> tuple[Float64[np.ndarray, "left 2"], Float64[np.ndarray, "right 2"], bool, bool]:
    """Both boundaries in driving direction (left on the left), and whether each was turned round.

    lanelet2 does not order the points of a way; which way is left of which decides, as in the library itself.
    """
    straight = np.hypot(*(left_m[0] - right_m[0])) + np.hypot(*(left_m[-1] - right_m[-1]))
    turned = np.hypot(*(left_m[0] - right_m[-1])) + np.hypot(*(left_m[-1] - right_m[0]))
    flip = bool(turned < straight)
    right = right_m[::-1] if flip else right_m
    ring = np.concatenate([left_m, right[::-1]]) - left_m[0]
    nxt = np.roll(ring, -1, axis=0)
    area = float((ring[:, 0] * nxt[:, 1] - ring[:, 1] * nxt[:, 0]).sum())
    if area > 0:  # counter-clockwise: the left one is on the right
        return left_m[::-1], right[::-1], True, not flip
    return left_m, right, False, flip


def evenly(line_m: Float64[np.ndarray, "point 2"], stations: int) -> Float64[np.ndarray, "station 2"]:
    """That many points, evenly along the line, its ends kept."""
    s = arc_length(line_m)
    at = np.linspace(0.0, s[-1], stations)
    return np.stack([np.interp(at, s, line_m[:, 0]), np.interp(at, s, line_m[:, 1])], axis=1)


def between(
    left_m: Float64[np.ndarray, "left 2"], right_m: Float64[np.ndarray, "right 2"]
) -> tuple[Float64[np.ndarray, "station 2"], float]:
    """The line in the middle of two aligned boundaries, a point about every STATION_M, and the median width (m)."""
    length = max(float(arc_length(left_m)[-1]), float(arc_length(right_m)[-1]))
    stations = int(np.clip(np.ceil(length / STATION_M) + 1, 3, MAX_STATIONS))
    left, right = evenly(left_m, stations), evenly(right_m, stations)
    return distinct((left + right) / 2), float(np.median(np.hypot(*(left - right).T)))


def crossed(lines_m: Sequence[Float64[np.ndarray, "_ 2"]]) -> Bool[np.ndarray, " line"]:
    """True for the lines that cross another one at more than MIN_CROSSING_RAD, elsewhere than at their ends."""
    if not lines_m:
        return np.zeros(0, bool)
    coarse = [evenly(line, max(2, min(len(line), 50))) for line in lines_m]
    bounds = np.concatenate([[0], np.cumsum([len(line) for line in coarse])])
    low, high = np.array([line.min(axis=0) for line in coarse]), np.array([line.max(axis=0) for line in coarse])
    return np.asarray(_crossed(np.concatenate(coarse), bounds, low, high, float(np.sin(MIN_CROSSING_RAD))))


@njit(cache=True, nogil=True)
@no_type_check
def _crossed(points, bounds, low, high, sine):
    """Which lines cross another one; line i has the points bounds[i] to bounds[i + 1], low and high are its box."""
    n = len(low)
    hit = np.zeros(n, np.bool_)
    for i in range(n):
        for j in range(i + 1, n):
            if low[j, 0] > high[i, 0] or low[j, 1] > high[i, 1] or high[j, 0] < low[i, 0] or high[j, 1] < low[i, 1]:
                continue
            if not (hit[i] and hit[j]) and _cross(points, bounds[i : i + 2], bounds[j : j + 2], sine):
                hit[i] = hit[j] = True
    return hit


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _cross(points, one, other, sine):
    """Whether a segment of one line crosses a segment of the other."""
    for i in range(one[0], one[1] - 1):
        px, py = points[i, 0], points[i, 1]
        rx, ry = points[i + 1, 0] - px, points[i + 1, 1] - py
        for j in range(other[0], other[1] - 1):
            gx, gy = points[j, 0] - px, points[j, 1] - py
            sx, sy = points[j + 1, 0] - points[j, 0], points[j + 1, 1] - points[j, 1]
            cross = rx * sy - ry * sx
            t, u = (gx * sy - gy * sx) / cross, (gx * ry - gy * rx) / cross
            if not (0.0 <= t <= 1.0 and 0.0 <= u <= 1.0):
                continue
            along = (i - one[0] + t) / (one[1] - one[0] - 1)
            across = (j - other[0] + u) / (other[1] - other[0] - 1)
            inner = _ENDS < along < 1 - _ENDS and _ENDS < across < 1 - _ENDS
            if inner and abs(cross) > sine * max(np.hypot(rx, ry) * np.hypot(sx, sy), 1e-12):
                return True
    return False
