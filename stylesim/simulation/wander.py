"""Lateral wander in the lane: driver state, advanced every step from style and seed, decided before any label.

An Ornstein-Uhlenbeck target x (sd and correlation time of the style) is followed by the vehicle through a critically
damped filter of 1.5 rad/s, w'' = f^2 (x - w) - 2 f w', whose acceleration is limited: position, velocity and
acceleration are finite, and a following path or heading can be derived. Time runs with the speed below 5 m/s and
stands still with the vehicle, so that nobody slides sideways.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from stylesim.style import DriverStyle

FILTER_RAD_PER_S = 1.5  # chosen, because lane keeping shows most power below about 0.25 Hz
STEERING_RAD_PER_S = 4.0  # of lane changes; chosen, because the lag (2 / 4 s) stays at half a second
LARGEST_SLIDE_MPS = 1.5  # lateral speed of a lane change at 5 m/s or more, so at most 0.3 of the speed below; chosen
LARGEST_ACCELERATION_MPS2 = 3.5  # chosen, because 4 m/s2 must hold with what a change of speed adds
FULL_SPEED_MPS = 5.0  # from there on time runs at its own pace; chosen, because 5 m/s is walking out of a queue
ROOM_BEYOND_LANE_M = 0.0  # the side reaches the marking and no further: who drives beside may wander, too; chosen


def filter_gain(correlation_time_s: Float64[np.ndarray, " agent"]) -> Float64[np.ndarray, " agent"]:
    """Sd of w / sd of x: sqrt((r + r^2) / 2) with r = f / (f + 1/T), from the stationary covariance [ours]."""
    r = FILTER_RAD_PER_S / (FILTER_RAD_PER_S + 1.0 / correlation_time_s)
    return np.asarray(np.sqrt((r + r**2) / 2.0))


@dataclass(frozen=True)
class WanderSwitch:
    """From `frame` on one agent wanders as another style, and with `stream` (where given) from other draws."""

    agent: int
    frame: int
    style: DriverStyle
    stream: np.random.Generator | None = None


def lateral_wander(
    styles: Sequence[DriverStyle],
    speed_mps: Float64[np.ndarray, "agent time"],
    *,
    limit_m: Float64[np.ndarray, " agent"],
    dt_s: float,
    streams: Sequence[np.random.Generator],
    switch: WanderSwitch | None = None,
) -> Float64[np.ndarray, "agent time"]:
    """The offset to the left of the path, m, for every driver and frame.

    `speed_mps` is 0 where a driver is not there. `limit_m` bounds the target softly (tanh), so that wide vehicles keep
    their lane. `streams[i]` gives driver i's draws and nobody else's; their number depends on the frames only, so
    a longer episode begins with the same wander. ValueError where the lengths differ.
    """
    agents, frames = speed_mps.shape
    if not len(styles) == len(streams) == len(limit_m) == agents:
        raise ValueError(f"{len(styles)} styles, {len(streams)} streams, {len(limit_m)} limits for {agents} drivers")
    time_s = np.array([style.lane_wander_time_s for style in styles], np.float64)
    sd_m = np.array([style.lane_wander_m for style in styles], np.float64)
    shocks = np.empty((frames + 1, agents))
    for column, rng in enumerate(streams):
        shocks[:, column] = rng.standard_normal(frames + 1)
    pace_s = dt_s * np.minimum(1.0, np.maximum(speed_mps.T, 0.0) / FULL_SPEED_MPS)
    keep = np.exp(-pace_s / time_s)
    start = shocks[0] * (sd_m / filter_gain(time_s))
    kicks = shocks[1:] * np.sqrt(1.0 - keep**2) * (sd_m / filter_gain(time_s))
    if switch is not None:
        _switch(switch, shocks, keep, pace_s, kicks)
    return np.ascontiguousarray(_follow(start, kicks, keep, pace_s, np.maximum(limit_m, 1e-3)).T)


def _switch(
    switch: WanderSwitch,
    shocks: Float64[np.ndarray, "start_and_time agent"],
    keep: Float64[np.ndarray, "time agent"],
    pace_s: Float64[np.ndarray, "time agent"],
    kicks: Float64[np.ndarray, "time agent"],
) -> None:
    """Puts the agent's later part into `keep` and `kicks`."""
    after, agent = slice(switch.frame, None), switch.agent
    draws = shocks[1:][after, agent]
    if switch.stream is not None:
        draws = switch.stream.standard_normal(len(draws))
    time_s = np.array([switch.style.lane_wander_time_s])
    keep[after, agent] = np.exp(-pace_s[after, agent] / time_s)
    sd_m = switch.style.lane_wander_m / filter_gain(time_s)
    kicks[after, agent] = draws * np.sqrt(1.0 - keep[after, agent] ** 2) * sd_m


def _follow(
    start: Float64[np.ndarray, " agent"],
    kicks: Float64[np.ndarray, "time agent"],
    keep: Float64[np.ndarray, "time agent"],
    pace_s: Float64[np.ndarray, "time agent"],
    limit_m: Float64[np.ndarray, " agent"],
) -> Float64[np.ndarray, "time agent"]:
    """Target and filter, step by step over all drivers at once."""
    target = start
    offset = limit_m * np.tanh(target / limit_m)
    rate = np.zeros_like(offset)
    result = np.empty_like(keep)
    for frame in range(len(keep)):
        target = keep[frame] * target + kicks[frame]
        pull = FILTER_RAD_PER_S**2 * (limit_m * np.tanh(target / limit_m) - offset) - 2.0 * FILTER_RAD_PER_S * rate
        pull = np.minimum(np.maximum(pull, -LARGEST_ACCELERATION_MPS2), LARGEST_ACCELERATION_MPS2)
        rate += pace_s[frame] * pull
        offset = offset + pace_s[frame] * rate
        result[frame] = offset
    return result


def smoothed_slide(
    slide_m: Float64[np.ndarray, "agent time"], speed_mps: Float64[np.ndarray, "agent time"], *, dt_s: float
) -> Float64[np.ndarray, "agent time"]:
    """A lateral position that slides over at constant speed (a simulator's lane change), as a driver would steer it.

    Critically damped with 4 rad/s, time running as in `lateral_wander`: it lags by 0.5 s and reads nothing later; a
    slide of 1.2 m/s accelerates by 1.2 * 4 / e = 1.8 m/s2 at most. Starts from the first frame's position.
    """
    pace_s = dt_s * np.minimum(1.0, np.maximum(speed_mps.T, 0.0) / FULL_SPEED_MPS)
    offset = slide_m[:, 0].copy()
    rate = np.zeros_like(offset)
    result = np.empty_like(pace_s)
    for frame, goal in enumerate(np.ascontiguousarray(slide_m.T)):
        pull = STEERING_RAD_PER_S**2 * (goal - offset) - 2.0 * STEERING_RAD_PER_S * rate
        rate = np.minimum(np.maximum(rate + pace_s[frame] * pull, -LARGEST_SLIDE_MPS), LARGEST_SLIDE_MPS)
        offset = offset + pace_s[frame] * rate
        result[frame] = offset
    return np.ascontiguousarray(result.T)
