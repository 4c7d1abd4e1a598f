"""Velocity and heading of tracks that come as positions only, from nothing later than the frame itself."""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from jaxtyping import Float64, Int64
from numba import njit

from stylesim.datasets.recording import NEVER

# Chosen: tracked positions jitter by decimetres, so the direction over less than a metre is noise; over a metre a
# car that turns at a radius of 8 m is 4 degrees behind.
COURSE_M = 1.0
MAX_GAP_S = 1.0  # chosen: over a longer gap a difference of positions is no velocity


def backward_velocity(
    agent: Int64[np.ndarray, " row"],
    frame: Int64[np.ndarray, " row"],
    position_m: Float64[np.ndarray, "row 2"],
    dt_s: float,
) -> tuple[Float64[np.ndarray, "row 2"], Int64[np.ndarray, " row"]]:
    """Velocity over the step that ends at each row, and how many frames later it is known.

    The first row of an agent (or after a gap of MAX_GAP_S) takes the step that follows and is known only with its
    end; a row with no neighbour has no velocity (NaN). Rows are sorted by agent, then frame.
    """
    velocity = np.full((len(agent), 2), np.nan)
    ahead = np.zeros(len(agent), np.int64)
    if len(agent) < 2:
        return velocity, ahead
    gap = np.diff(frame)
    near = (np.diff(agent) == 0) & (gap * dt_s <= MAX_GAP_S + 1e-9)
    step = np.diff(position_m, axis=0) / np.maximum(gap, 1)[:, None] / dt_s
    velocity[1:][near] = step[near]
    first = np.concatenate([near, [False]]) & ~np.concatenate([[False], near])
    velocity[first] = step[first[:-1]]
    ahead[first] = gap[first[:-1]]
    return velocity, ahead


def courses(
    agent: Int64[np.ndarray, " row"], frame: Int64[np.ndarray, " row"], position_m: Float64[np.ndarray, "row 2"]
) -> tuple[Float64[np.ndarray, " row"], Int64[np.ndarray, " row"]]:
    """Direction of travel (rad) at each row, and how many frames later it is known (NEVER: it never moved; NaN).

    From the last place COURSE_M or more behind; held while standing; before the first metre is driven, the
    direction of that metre, known when it is driven.
    """
    heading, known_at = _courses(agent, position_m, COURSE_M)
    ahead = np.full(len(agent), NEVER, np.int64)
    moved = known_at >= 0
    ahead[moved] = np.clip(frame[known_at[moved]] - frame[moved], 0, NEVER)
    return heading, ahead


@njit(cache=True, nogil=True)
@no_type_check
def _courses(agent, position, reach):
    n = len(agent)
    heading = np.full(n, np.nan)
    known_at = np.full(n, -1, np.int64)
    first = 0
    for end in range(1, n + 1):
        if end < n and agent[end] == agent[first]:
            continue
        behind, last, begun = first, np.nan, False
        for i in range(first, end):
            for j in range(behind + 1, i):
                dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
                if dx * dx + dy * dy < reach * reach:
                    break
                behind = j
            dx, dy = position[i, 0] - position[behind, 0], position[i, 1] - position[behind, 1]
            if dx * dx + dy * dy >= reach * reach:
                last = np.arctan2(dy, dx)
                if not begun:
                    begun = True
                    for k in range(first, i):
                        heading[k] = last
                        known_at[k] = i
            if begun:
                heading[i] = last
                known_at[i] = i
        first = end
    return heading, known_at
