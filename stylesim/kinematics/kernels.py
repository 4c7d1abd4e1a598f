"""The smoother's loops, compiled by numba at their first call and cached; imported only by functions that run them.

Each loop runs over agents in a fixed order on one core, so the same input gives the same bits.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
@no_type_check
def run_end(run, agent, start):
    """The first frame after `start` that does not belong to its run."""
    stop = start + 1
    while stop < run.shape[1] and run[agent, stop] == run[agent, start]:
        stop += 1
    return stop


@njit(cache=True, nogil=True)
@no_type_check
def fit_at(values, agent, channel, frame, first, width, operator, total):
    """Value and derivatives at one frame from the `width` samples after `first`; total [4] is written."""
    # Relative to the sample itself, so that a far origin costs no digits.
    base = np.float64(values[agent, frame, channel])
    total[:] = 0.0
    for i in range(width):
        away = values[agent, first + i, channel] - base
        for order in range(4):
            total[order] += operator[i, order] * away
    total[0] += base


@njit(cache=True, nogil=True)
@no_type_check
def local_polynomial(values, run, operators, least, out):
    """Fit a polynomial around every sample of every run and write its value and derivatives.

    values [agent time channel], run [agent time] (an unbroken run shares a number, -1: nothing there),
    operators [run length - least, place in the window, sample, derivative], out [agent time channel derivative].
    """
    agents, frames = run.shape
    taps = operators.shape[1]
    for agent in range(agents):
        start = 0
        while start < frames:
            stop = run_end(run, agent, start)
            width = min(stop - start, taps)
            if run[agent, start] >= 0 and width >= least:
                for frame in range(start, stop):
                    first = max(start, min(frame - width // 2, stop - width))
                    operator = operators[width - least, frame - first]
                    for channel in range(values.shape[2]):
                        fit_at(values, agent, channel, frame, first, width, operator, out[agent, frame, channel])
            start = stop


@njit(cache=True, nogil=True)
@no_type_check
def path_motion(values, heading, run, operators, least, slow, place, direction, speed, acceleration, jerk):
    """Smoothed position and, along the path, direction, speed, acceleration and jerk (see `smoothing.motion`).

    values [agent time 2], the rest as in `local_polynomial`; place, direction [agent time 2] and the others
    [agent time] are written where there is a motion.
    """
    agents, frames = run.shape
    taps = operators.shape[1]
    x, y = np.empty(4), np.empty(4)
    for agent in range(agents):
        start = 0
        while start < frames:
            stop = run_end(run, agent, start)
            width = min(stop - start, taps)
            if run[agent, start] >= 0 and width >= least:
                for frame in range(start, stop):
                    first = max(start, min(frame - width // 2, stop - width))
                    operator = operators[width - least, frame - first]
                    fit_at(values, agent, 0, frame, first, width, operator, x)
                    fit_at(values, agent, 1, frame, first, width, operator, y)
                    v = np.sqrt(x[1] * x[1] + y[1] * y[1])
                    if v > slow:
                        ux, uy = x[1] / v, y[1] / v
                        across = y[2] * ux - x[2] * uy
                        bend = across * across / v
                    else:
                        angle = np.float64(heading[agent, frame])
                        ux, uy, bend = np.cos(angle), np.sin(angle), 0.0
                    place[agent, frame, 0], place[agent, frame, 1] = x[0], y[0]
                    direction[agent, frame, 0], direction[agent, frame, 1] = ux, uy
                    speed[agent, frame] = v
                    acceleration[agent, frame] = x[2] * ux + y[2] * uy
                    jerk[agent, frame] = x[3] * ux + y[3] * uy + bend
            start = stop
