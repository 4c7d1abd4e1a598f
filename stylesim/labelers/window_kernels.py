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


@njit(cache=True, nogil=True)
@no_type_check
def window_traffic(speed, is_vehicle, window, traffic):
    """The median over a window's frames, from its first to its last, of the median speed of the vehicles then.

    speed, is_vehicle, window [agent time]; traffic [agent window] comes as NaN.
    """
    agents, frames = window.shape
    typical = np.full(frames, np.nan)
    here = np.empty(max(agents, frames))
    for frame in range(frames):
        count = 0
        for agent in range(agents):
            if is_vehicle[agent, frame] and not np.isnan(speed[agent, frame]):
                here[count] = speed[agent, frame]
                count += 1
        if count > 0:
            typical[frame] = np.median(here[:count])
    first, last = np.empty(traffic.shape[1], np.int64), np.empty(traffic.shape[1], np.int64)
    for agent in range(agents):
        first[:] = -1
        for frame in range(frames):
            at = window[agent, frame]
            if at >= 0:
                first[at] = frame if first[at] < 0 else first[at]
                last[at] = frame
        for at in range(traffic.shape[1]):
            if first[at] < 0:
                continue
            count = 0
            for frame in range(first[at], last[at] + 1):
                if not np.isnan(typical[frame]):
                    here[count] = typical[frame]
                    count += 1
            if count > 0:
                traffic[agent, at] = np.median(here[:count])
