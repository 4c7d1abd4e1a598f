"""What every labeller does with its scores."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64


def margin(score: Float64[np.ndarray, "row style"]) -> Float64[np.ndarray, " row"]:
    """Best score minus second best; NaN where a score is missing."""
    if not len(score):
        return np.zeros(0)
    two = np.partition(score, -2, axis=1)[:, -2:]
    return np.where(np.isfinite(score).all(axis=1), two[:, 1] - two[:, 0], np.nan)
