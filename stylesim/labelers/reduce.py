"""Mean, variance and maximum of a value over the frames of each (agent, window)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.labelers.cuts import Cut


@dataclass(frozen=True, eq=False)
class Moments:
    """Of the known (finite) values of each window; NaN where it has none."""

    count: Int64[np.ndarray, "agent window"]
    mean: Float64[np.ndarray, "agent window"]
    variance: Float64[np.ndarray, "agent window"]  # mean squared deviation from the window's mean
    maximum: Float64[np.ndarray, "agent window"]


def moments(value: Float64[np.ndarray, "agent time"], cut: Cut) -> Moments:
    """Moments of a quantity over each window."""
    from stylesim.labelers.window_kernels import window_moments

    shape = (len(cut.window), cut.n_windows)
    result = Moments(np.zeros(shape, np.int64), *(np.full(shape, np.nan) for _ in range(3)))
    window_moments(value, cut.window, result.count, result.mean, result.variance, result.maximum)
    return result


def frame_count(chosen: Bool[np.ndarray, "agent time"], cut: Cut) -> Int64[np.ndarray, "agent window"]:
    """How many chosen frames each window has."""
    from stylesim.labelers.window_kernels import window_count

    result = np.zeros((len(cut.window), cut.n_windows), np.int64)
    window_count(chosen, cut.window, result)
    return result
