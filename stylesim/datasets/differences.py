"""Velocities of formats that give positions only, from what was seen so far: no velocity knows a later frame."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int64


def causal_velocity(
    position_m: Float64[np.ndarray, "agent time 2"],
    valid: Bool[np.ndarray, "agent time"],
    time_s: Float64[np.ndarray, " time"],
    stride: int = 1,
) -> tuple[Float64[np.ndarray, "agent time 2"], Int64[np.ndarray, "agent time"]]:
    """Velocity at each valid frame, and how many frames later a frame that it depends on is.

    The slope at the newest point of the parabola through the frames i, i - stride and i - 2 stride, at their own
    times (exact for constant acceleration, and not late, unlike the mere difference); of the line through two frames
    where there are no three. Only the first frame of a track has to look ahead. NaN where a track has a single frame
    nearby.
    """
    velocity = np.full(position_m.shape, np.nan)
    ahead = np.zeros(valid.shape, np.int64)
    n = valid.shape[1]
    for lag in (*range(stride, 0, -1), *range(-1, -stride - 1, -1)):
        if abs(lag) >= n:
            continue
        there = np.zeros(valid.shape, bool)
        slope = np.full(position_m.shape, np.nan)
        now, then = (slice(lag, n), slice(0, n - lag)) if lag > 0 else (slice(0, n + lag), slice(-lag, n))
        there[:, now] = valid[:, now] & valid[:, then]
        with np.errstate(over="ignore", invalid="ignore"):  # of a damaged position: its rows are dropped later
            slope[:, now] = (position_m[:, now] - position_m[:, then]) / (time_s[now] - time_s[then])[:, None]
        new = there & np.isnan(velocity).any(-1)
        velocity[new] = slope[new]
        ahead[new] = max(0, -lag)
        if lag == stride and n > 2 * stride:
            bent = np.zeros(valid.shape, bool)
            bent[:, stride:] = there[:, stride:] & there[:, :-stride]
            share = (time_s[2 * stride :] - time_s[stride:-stride]) / (time_s[2 * stride :] - time_s[: -2 * stride])
            turned = slope.copy()
            with np.errstate(over="ignore", invalid="ignore"):
                turned[:, 2 * stride :] += share[:, None] * (slope[:, 2 * stride :] - slope[:, stride:-stride])
            velocity[bent] = turned[bent]
    return velocity, ahead
