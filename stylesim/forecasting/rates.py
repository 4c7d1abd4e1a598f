"""Histories and forecasts at another rate: what a forecaster that was made for 2 Hz or 20 Hz sees and says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int64

from stylesim.geometry import wrap_angle
from stylesim.scene import Scene

RATE_TOLERANCE = 1e-6  # of a frame: rounding of i * dt_s


def history_at(history: Scene, *, dt_s: float, steps: int) -> Scene:
    """The last `steps` frames of a history at steps of `dt_s`, the last one at t0.

    Between two frames positions, velocities and headings go linearly, and only where both are known; lights keep their
    earlier state. Times before the first frame are not valid. A history of that rate is cut, not interpolated.
    """
    tracks = history.tracks
    at = (tracks.n_frames - 1) - np.arange(steps - 1, -1, -1) * dt_s / tracks.dt_s
    before, share, inside = _places(at, tracks.n_frames)
    after = np.minimum(before + 1, tracks.n_frames - 1)
    valid = tracks.valid[:, before] & (tracks.valid[:, after] | (share == 0.0)) & inside
    w = share[None, :, None]
    position = _between(tracks.position_m, before, after, w)
    velocity = _between(tracks.velocity_mps, before, after, w)
    first = tracks.heading_rad[:, before]
    turn = np.where(share > 0, wrap_angle(tracks.heading_rad[:, after] - first) * share, 0.0)
    gone = ~valid
    signals = history.signals
    return replace(
        history,
        tracks=replace(
            tracks,
            position_m=np.where(gone[..., None], np.nan, position),
            velocity_mps=np.where(gone[..., None], np.nan, velocity),
            heading_rad=np.where(gone, np.nan, wrap_angle(first + turn)),
            valid=valid,
            dt_s=dt_s,
            lookahead_steps=None,
        ),
        signals=None if signals is None else replace(signals, state=signals.state[:, before]),
    )


def _places(
    at: Float64[np.ndarray, " step"], frames: int
) -> tuple[Int64[np.ndarray, " step"], Float64[np.ndarray, " step"], Bool[np.ndarray, " step"]]:
    """The frame before each (fractional) frame, the share of the next one, and whether it is within the history."""
    near = np.rint(at)
    at = np.where(np.abs(at - near) < RATE_TOLERANCE, near, at)
    inside = at >= 0
    at = np.clip(at, 0, frames - 1)
    before = np.floor(at).astype(np.int64)
    return before, at - before, inside


def _between(
    value: Float32[np.ndarray, "agent time 2"],
    before: Int64[np.ndarray, " step"],
    after: Int64[np.ndarray, " step"],
    share: Float64[np.ndarray, "1 step 1"],
) -> Float64[np.ndarray, "agent step 2"]:
    """Linear between two frames; the first one alone where its share is 1, also if the next is unknown."""
    first = value[:, before].astype(np.float64)
    return np.where(share == 0.0, first, first + share * (value[:, after] - first))


def path_at(
    path_m: Float[np.ndarray, "driver mode time 2"],
    start_m: Float[np.ndarray, "driver 2"],
    *,
    dt_s: float,
    wanted_dt_s: float,
    steps: int,
) -> Float64[np.ndarray, "driver mode step 2"]:
    """A forecast in steps of `dt_s` (its first point at t0 + dt_s) as `steps` points in steps of `wanted_dt_s`.

    Linear between its points, from the driver's place at t0 on. ValueError where it does not reach that far.
    """
    there = path_m.shape[2] * dt_s
    if steps * wanted_dt_s > there + RATE_TOLERANCE:
        raise ValueError(f"the forecast ends after {there:g} s; {steps * wanted_dt_s:g} s are asked")
    drivers, modes = path_m.shape[:2]
    begin = np.broadcast_to(start_m[:, None, None].astype(np.float64), (drivers, modes, 1, 2))
    whole = np.concatenate([begin, path_m.astype(np.float64)], axis=2)
    before, share, _ = _places(np.arange(1, steps + 1) * wanted_dt_s / dt_s, whole.shape[2])
    after = np.minimum(before + 1, whole.shape[2] - 1)
    return whole[:, :, before] * (1 - share[:, None]) + whole[:, :, after] * share[:, None]
