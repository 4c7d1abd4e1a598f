"""Overlaps between logged boxes, found again on what is logged whatever the simulator thought."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, Int64

from stylesim.geometry import box_corners, boxes_overlap

SWEEP = np.array([0.8, 0.6])  # neither along nor square to most roads, so that few vehicles share a place


def overlaps(
    frame: Int[np.ndarray, " row"],
    agent: Int[np.ndarray, " row"],
    position_m: Float[np.ndarray, "row 2"],
    heading_rad: Float[np.ndarray, " row"],
    size_m: Float[np.ndarray, "row 2"],
) -> Int64[np.ndarray, "overlap 3"]:
    """(frame, agent, agent) for every two boxes that overlap in a frame, by a sweep over all frames at once."""
    if len(frame) < 2:
        return np.zeros((0, 3), np.int64)
    place = (position_m.astype(np.float64) - position_m.min(axis=0)) @ SWEEP
    radius = np.hypot(size_m[:, 0], size_m[:, 1]).astype(np.float64) / 2
    reach = 2 * float(radius.max())
    key = frame * (float(place.max()) + 2 * reach) + place
    order = np.argsort(key, kind="stable")
    key = key[order]
    found = []
    left = np.arange(len(key) - 1)
    for shift in range(1, len(key)):
        left = left[left + shift < len(key)]
        left = left[key[left + shift] - key[left] <= reach]
        if not len(left):
            break
        a, b = order[left], order[left + shift]
        apart = np.hypot(*(position_m[a] - position_m[b]).T)
        close = apart < radius[a] + radius[b]
        a, b = a[close], b[close]
        hit = boxes_overlap(
            box_corners(position_m[a], heading_rad[a], size_m[a]), box_corners(position_m[b], heading_rad[b], size_m[b])
        )
        found.append(np.stack([frame[a[hit]], agent[a[hit]], agent[b[hit]]], axis=1).astype(np.int64))
    return np.concatenate(found) if found else np.zeros((0, 3), np.int64)
