"""Sums over windows, compiled by numba at their first call and cached."""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
@no_type_check
def window_moments(value, window, count, mean, variance, largest):
    """Count, mean, mean squared deviation and maximum of the finite values of each window.

    value, window [agent time]; the others [agent window], where count comes as 0 and the rest as NaN.
    """
    agents, frames = window.shape
    for agent in range(agents):
        for frame in range(frames):
            at = window[agent, frame]
            x = value[agent, frame]
            if at < 0 or not np.isfinite(x):
                continue
            if count[agent, at] == 0:
                mean[agent, at], variance[agent, at], largest[agent, at] = 0.0, 0.0, x
            count[agent, at] += 1
            mean[agent, at] += x
            largest[agent, at] = max(largest[agent, at], x)
        for at in range(count.shape[1]):
            mean[agent, at] /= max(1, count[agent, at])
        for frame in range(frames):
            at = window[agent, frame]
            if at >= 0 and np.isfinite(value[agent, frame]):
                variance[agent, at] += (value[agent, frame] - mean[agent, at]) ** 2
        for at in range(count.shape[1]):
            variance[agent, at] /= max(1, count[agent, at])


@njit(cache=True, nogil=True)
@no_type_check
def window_count(chosen, window, count):
    """How many chosen frames each window has; chosen, window [agent time], count [agent window] comes as 0."""
    agents, frames = window.shape
    for agent in range(agents):
        for frame in range(frames):
            if chosen[agent, frame] and window[agent, frame] >= 0:
                count[agent, window[agent, frame]] += 1
