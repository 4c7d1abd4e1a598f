"""Rows of a long table: which of them can be road users in metres."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.datasets.dense import MAX_COORDINATE_M, MAX_LOST_SHARE
from stylesim.datasets.plausible import MAX_DISTANCE_M, MAX_LENGTH_M, MAX_SPEED_MPS, MAX_WIDTH_M, MIN_SIDE_M
from stylesim.errors import InputError


def usable(
    position_m: Float64[np.ndarray, "row 2"],
    velocity_mps: Float64[np.ndarray, "row 2"],
    heading_rad: Float64[np.ndarray, " row"],
    size_m: Float64[np.ndarray, "row 2"],
    *,
    file: Path,
) -> tuple[Bool[np.ndarray, " row"], dict[str, int]]:
    """True for the rows that can be used, and how many were dropped: `unreadable`, `implausible`.

    The bounds are those of `dense.checked_tracks`, distances from the median of all places. InputError naming
    `file` where more than half of the rows are lost.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        numbers = np.concatenate([position_m, velocity_mps, heading_rad[:, None], size_m], axis=1)
        readable = np.isfinite(numbers).all(axis=1)
        sane = readable & (np.abs(position_m) < MAX_COORDINATE_M).all(axis=1) & (np.abs(heading_rad) < 1e4)
        middle = np.median(position_m[sane], axis=0) if sane.any() else np.zeros(2)
        kept = sane & (np.abs(position_m - middle) <= MAX_DISTANCE_M).all(axis=1)
        kept &= np.hypot(velocity_mps[:, 0], velocity_mps[:, 1]) <= MAX_SPEED_MPS
        kept &= (size_m >= MIN_SIDE_M).all(axis=1) & (size_m[:, 0] <= MAX_LENGTH_M) & (size_m[:, 1] <= MAX_WIDTH_M)
    dropped = {"unreadable": int((~readable).sum()), "implausible": int((readable & ~kept).sum())}
    if sum(dropped.values()) > MAX_LOST_SHARE * len(kept) or not kept.any():
        raise InputError(
            f"{file}: of {len(kept)} rows {dropped['unreadable']} are not finite and {dropped['implausible']} cannot "
            "be road users in metres; it is damaged or in other units"
        )
    return kept, dropped
