"""Which part of its boundaries lies abreast of each lane: for all lanes of a map at once, since maps have hundreds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import no_type_check

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64
from numba import njit

from stylesim.datasets.polylines import distinct_points

MAX_HALF_WIDTH_M = 5.0  # chosen: a boundary farther from the centre is not that of this lane

Stretch = tuple[str, int, int]  # id of a feature, and from which to which point of the lane it is beside it
Boundary = tuple[Float32[np.ndarray, "_ 2"] | None, float]


def boundaries(
    centres_m: Sequence[Float64[np.ndarray, "_ 2"]],
    stretches: Sequence[Sequence[Stretch]],
    lines: Mapping[str, Float32[np.ndarray, "_ 2"]],
) -> list[Boundary]:
    """For each centre line and the stretches of one side of it, the feet of its points on the boundaries.

    With it the median distance to them. Points farther than MAX_HALF_WIDTH_M from the boundary have no foot; (None,
    NaN) where fewer than two have one.
    """
    names = {name: number for number, (name, line) in enumerate(lines.items()) if len(line) >= 2}
    places, owner, on = [], [], []
    for side, (centre, asked) in enumerate(zip(centres_m, stretches, strict=True)):
        for feature, start, end in sorted(asked, key=lambda s: s[1]):
            beside = centre[max(start, 0) : end + 1]
            if feature in names and len(beside):
                places.append(beside)
                owner.append(side)
                on.append(names[feature])
    if not places:
        return [(None, float("nan"))] * len(centres_m)
    count = np.array([len(beside) for beside in places])
    there = np.concatenate(places)
    feet, found = _on_lines(there, np.concatenate([[0], np.cumsum(count)]), list(lines.values()), np.array(on))
    apart = np.hypot(feet[:, 0] - there[:, 0], feet[:, 1] - there[:, 1])
    near = found & (apart <= MAX_HALF_WIDTH_M)
    return _by_side(feet[near], apart[near], np.repeat(owner, count)[near], len(centres_m))


def _by_side(
    feet_m: Float64[np.ndarray, "foot 2"],
    apart_m: Float64[np.ndarray, " foot"],
    side: Int64[np.ndarray, " foot"],
    n_sides: int,
) -> list[Boundary]:
    """The line and the median distance of each side; sides ascend."""
    bounds = np.searchsorted(side, np.arange(n_sides + 1))
    count = np.diff(bounds)
    ordered = apart_m[np.lexsort((apart_m, side))]
    some = count >= 2
    low, high = (bounds[:-1] + (count - 1) // 2)[some], (bounds[:-1] + count // 2)[some]
    median = np.full(n_sides, np.nan)
    median[some] = np.where(low == high, ordered[low], (ordered[low] + ordered[high]) / 2)
    lines = distinct_points(feet_m, side, n_sides)
    return [(lines[i] if some[i] else None, float(median[i])) for i in range(n_sides)]


def _on_lines(
    places_m: Float64[np.ndarray, "place 2"],
    first: Int64[np.ndarray, " task_1"],
    lines_m: list[Float32[np.ndarray, "_ 2"]],
    line: Int64[np.ndarray, " task"],
) -> tuple[Float64[np.ndarray, "place 2"], Bool[np.ndarray, " place"]]:
    """The foot of places first[k] to first[k + 1] on line[k], and where there is one."""
    points = np.concatenate(lines_m)
    bounds = np.concatenate([[0], np.cumsum([len(one) for one in lines_m])])
    begin, end = bounds[line], bounds[line + 1]
    step = np.diff(points, axis=0, append=points[-1:])
    long = np.hypot(step[:, 0], step[:, 1])
    long[bounds[1:][np.diff(bounds) > 0] - 1] = 0.0  # from one line to the next there is no step
    # Boundaries are long: no point outside of this box is within MAX_HALF_WIDTH_M of a place.
    reach = np.array([MAX_HALF_WIDTH_M + float(long[a:b].max()) for a, b in zip(begin, end, strict=True)])
    low = np.minimum.reduceat(places_m, first[:-1]) - reach[:, None]
    high = np.maximum.reduceat(places_m, first[:-1]) + reach[:, None]
    wide = points.astype(np.float64)
    step = np.diff(wide, axis=0, append=wide[-1:])
    length = np.hypot(step[:, 0], step[:, 1])
    return _feet(places_m, first, begin, end, low, high, wide, length)


@njit(cache=True, nogil=True)
@no_type_check
def _feet(places, first, begin, end, low, high, points, length):
    """As `polylines.nearest_points`, place by place in the same order of operations."""
    feet, found = np.zeros(places.shape), np.zeros(len(places), np.bool_)
    for task in range(len(begin)):
        one, last = -1, -1
        for j in range(begin[task], end[task]):
            x, y = points[j, 0], points[j, 1]
            if low[task, 0] <= x <= high[task, 0] and low[task, 1] <= y <= high[task, 1]:
                last = j
                if one < 0:
                    one = j
        if one < 0:
            continue
        one, last = max(one - 1, begin[task]), min(last + 1, end[task] - 1)
        if last == one:
            continue
        for i in range(first[task], first[task + 1]):
            nearest, along = np.inf, 0.0
            for j in range(one, last):
                dx, dy = points[j + 1, 0] - points[j, 0], points[j + 1, 1] - points[j, 1]
                ax, ay = places[i, 0] - points[j, 0], places[i, 1] - points[j, 1]
                t = min(max((ax * dx + ay * dy) / max(length[j] * length[j], 1e-12), 0.0), 1.0)
                gx, gy = ax - t * dx, ay - t * dy
                squared = gx * gx + gy * gy
                if squared < nearest:
                    nearest = squared
                    share = ((along + t * length[j]) - along) / max(length[j], 1e-12)
                    feet[i, 0], feet[i, 1] = points[j, 0] + share * dx, points[j, 1] + share * dy
                along += length[j]
            found[i] = nearest < np.inf
    return feet, found
