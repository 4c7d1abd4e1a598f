"""Lanes whose centre lines cross are in a junction: for maps that do not say which lanes are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

MIN_ANGLE_RAD = np.deg2rad(20.0)  # chosen: lanes that merge or split meet at less
MAX_POINTS = 30  # per lane; chosen: a lane of 100 m then has a point every 3.4 m
CLEARANCE_M = 3.0  # chosen: lanes this far above one another are a bridge; clearances are 4 m and more
_EPS = 1e-3  # a crossing this close to the end of a segment is counted with the next segment


def crossing(lines: Mapping[str, Any]) -> set[str]:
    """The ids of lines ([point, 2], or [point, 3] with heights) that cross another one at an angle, at its height."""
    thinned = {key: _thinned(np.asarray(line, np.float64)) for key, line in lines.items() if len(line) >= 2}
    keys = list(thinned)
    low = np.array([line[:, :2].min(axis=0) for line in thinned.values()]).reshape(-1, 2)
    high = np.array([line[:, :2].max(axis=0) for line in thinned.values()]).reshape(-1, 2)
    segments = {key: np.concatenate([line[:-1], line[1:]], axis=1) for key, line in thinned.items()}
    found: set[str] = set()
    for i, key in enumerate(keys[:-1]):
        touch = (low[i + 1 :] <= high[i]).all(axis=1) & (high[i + 1 :] >= low[i]).all(axis=1)
        near = [keys[i + 1 + j] for j in np.flatnonzero(touch)]
        if not near:
            continue
        others = np.concatenate([segments[other] for other in near])
        owner = np.repeat(np.arange(len(near)), [len(segments[other]) for other in near])
        hit = _cross(segments[key], others).any(axis=0)
        if hit.any():
            found.add(key)
            found.update(near[j] for j in np.unique(owner[hit]))
    return found


def _thinned(line: Float64[np.ndarray, "point _"]) -> Float64[np.ndarray, "kept 3"]:
    at = np.unique(np.linspace(0, len(line) - 1, MAX_POINTS).round().astype(int))
    height = line[at, 2] if line.shape[1] > 2 else np.zeros(len(at))
    return np.stack([line[at, 0], line[at, 1], height], -1)


def _cross(one: Float64[np.ndarray, "a 6"], other: Float64[np.ndarray, "b 6"]) -> Bool[np.ndarray, "a b"]:
    """Which segments (x, y, z of both ends) cross."""
    p, q = one[:, None, :2], other[None, :, :2]
    r, s = one[:, None, 3:5] - p, other[None, :, 3:5] - q
    cross = r[..., 0] * s[..., 1] - r[..., 1] * s[..., 0]
    gap = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (gap[..., 0] * s[..., 1] - gap[..., 1] * s[..., 0]) / cross
        u = (gap[..., 0] * r[..., 1] - gap[..., 1] * r[..., 0]) / cross
    lengths = np.hypot(r[..., 0], r[..., 1]) * np.hypot(s[..., 0], s[..., 1])
    inside = (t > _EPS) & (t < 1 - _EPS) & (u > _EPS) & (u < 1 - _EPS)
    steep = np.abs(cross) > np.sin(MIN_ANGLE_RAD) * lengths
    apart = np.abs((one[:, None, 2] + one[:, None, 5]) - (other[None, :, 2] + other[None, :, 5])) / 2
    return inside & steep & (apart < CLEARANCE_M)
