"""Lane geometry that map formats share: two boundaries in order, the line between them, lanes that cross."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from stylesim.geometry import arc_length

STATION_M = 1.0  # chosen: at a turning radius of 8 m the chord is 2 cm off the arc
MAX_STATIONS = 2000  # chosen: bounds what a damaged file can ask for; 2 km of one lane are still every metre
MIN_CROSSING_RAD = np.deg2rad(15.0)  # chosen: lanes that merge or split do so at less, lanes that cross at more
SAME_POINT_M = 1e-3


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
    hit = np.zeros(len(lines_m), bool)
    coarse = [evenly(line, max(2, min(len(line), 50))) for line in lines_m]
    low = np.array([line.min(axis=0) for line in coarse]).reshape(-1, 2)
    high = np.array([line.max(axis=0) for line in coarse]).reshape(-1, 2)
    for i, line in enumerate(coarse):
        near = ((low <= high[i]) & (high >= low[i])).all(axis=1)
        for j in np.flatnonzero(near).tolist():
            if j > i and not (hit[i] and hit[j]) and _cross(line, coarse[j]):
                hit[i] = hit[j] = True
    return hit


def _cross(one: Float[np.ndarray, "a 2"], other: Float[np.ndarray, "b 2"]) -> bool:
    first, second = _reaching(one, other), _reaching(other, one)  # most segments of most pairs cannot meet
    if not (len(first) and len(second)):
        return False
    p, r = one[first, None], (one[first + 1] - one[first])[:, None]
    q, s = other[None, second], (other[second + 1] - other[second])[None]
    cross = r[..., 0] * s[..., 1] - r[..., 1] * s[..., 0]
    apart = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (apart[..., 0] * s[..., 1] - apart[..., 1] * s[..., 0]) / cross
        u = (apart[..., 0] * r[..., 1] - apart[..., 1] * r[..., 0]) / cross
    meet = (t >= 0) & (t <= 1) & (u >= 0) & (u <= 1)
    if not meet.any():
        return False
    sine = np.abs(cross) / np.maximum(np.hypot(r[..., 0], r[..., 1]) * np.hypot(s[..., 0], s[..., 1]), 1e-12)
    meet &= sine > np.sin(MIN_CROSSING_RAD)
    along = (first[:, None] + t) / (len(one) - 1)
    across = (second[None] + u) / (len(other) - 1)
    inner = (along > 0.02) & (along < 0.98) & (across > 0.02) & (across < 0.98)  # chosen: 2 % of the length are ends
    return bool((meet & inner).any())


def _reaching(one: Float[np.ndarray, "a 2"], other: Float[np.ndarray, "b 2"]) -> Int64[np.ndarray, " segment"]:
    """The segments of one line whose boxes touch the box of the other, with a millimetre to spare for rounding."""
    low, high = other.min(axis=0) - SAME_POINT_M, other.max(axis=0) + SAME_POINT_M
    over, under = one >= low, one <= high
    return np.flatnonzero(((over[:-1] | over[1:]) & (under[:-1] | under[1:])).all(axis=1))
