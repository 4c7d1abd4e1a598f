"""One clock: scenes of any rate brought to 0.1 s."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.geometry import wrap_angle
from stylesim.scene import Scene
from stylesim.signals import Signals
from stylesim.tracks import Tracks

COMMON_DT_S = 0.1  # docs/architecture.md
_SAME_S = 1e-6  # two steps closer than this are one
_FAR = 32767


def on_common_clock(scene: Scene, dt_s: float = COMMON_DT_S) -> Scene:
    """The scene with frames every `dt_s`.

    A step that divides `dt_s` is decimated: the values stay the source's. Other steps are interpolated: position
    by the cubic that has the source's positions *and* velocities at both neighbours, velocity and heading (the
    short way round) linearly, so that no acceleration is larger than between two frames of the source. A frame is
    valid where both neighbours are; it is known only once the later one is (`lookahead_steps`). Lights hold the
    state of the frame before. `t0_frame` becomes the last frame at or before the source's.
    """
    have = scene.tracks.dt_s
    if abs(have - dt_s) < _SAME_S:
        return scene
    n_frames = int(np.floor((scene.tracks.n_frames - 1) * have / dt_s + _SAME_S)) + 1
    at = np.arange(n_frames) * dt_s / have
    near = np.round(at)
    at = np.where(np.abs(at - near) < _SAME_S / have, near, at)
    before = np.floor(at).astype(np.int64)
    after = np.minimum(np.ceil(at).astype(np.int64), scene.tracks.n_frames - 1)
    signals = scene.signals
    if signals is not None:
        signals = Signals(signal_id=signals.signal_id, lane_id=signals.lane_id, state=signals.state[:, before])
    t0 = None if scene.t0_frame is None else int(np.floor(scene.t0_frame * have / dt_s + _SAME_S))
    return replace(scene, tracks=_between(scene.tracks, at, before, after, dt_s), signals=signals, t0_frame=t0)


def _between(
    tracks: Tracks,
    at: Float64[np.ndarray, " time"],
    before: Int64[np.ndarray, " time"],
    after: Int64[np.ndarray, " time"],
    dt_s: float,
) -> Tracks:
    u = at - before
    valid = tracks.valid[:, before] & tracks.valid[:, after]
    heading = tracks.heading_rad[:, before].astype(np.float64)
    heading = wrap_angle(heading + u * wrap_angle(tracks.heading_rad[:, after] - heading))
    velocity = tracks.velocity_mps[:, before] * (1 - u)[:, None] + tracks.velocity_mps[:, after] * u[:, None]
    ahead = np.zeros(tracks.valid.shape, np.int64)
    if tracks.lookahead_steps is not None:
        ahead = tracks.lookahead_steps.astype(np.int64)
    # The later of the two neighbours' own needs, as a time from the new frame, in new steps, rounded up.
    needs = np.maximum(before + ahead[:, before], after + ahead[:, after]) - at
    steps = np.ceil(needs * tracks.dt_s / dt_s - _SAME_S)
    position = _cubic(tracks, u, before, after)
    return replace(
        tracks,
        position_m=np.where(valid[..., None], position, np.nan).astype(np.float32),
        velocity_mps=np.where(valid[..., None], velocity, np.nan).astype(np.float32),
        heading_rad=np.where(valid, heading, np.nan).astype(np.float32),
        valid=valid,
        dt_s=dt_s,
        lookahead_steps=np.where(valid, np.minimum(steps, _FAR), 0).astype(np.int16),
    )


def _cubic(
    tracks: Tracks,
    u: Float64[np.ndarray, " time"],
    before: Int64[np.ndarray, " time"],
    after: Int64[np.ndarray, " time"],
) -> Float64[np.ndarray, "agent time 2"]:
    """Hermite's cubic between neighbouring frames."""
    u = u[:, None]
    h00, h10 = 2 * u**3 - 3 * u**2 + 1, u**3 - 2 * u**2 + u
    h01, h11 = -2 * u**3 + 3 * u**2, u**3 - u**2
    p, v = tracks.position_m.astype(np.float64), tracks.velocity_mps.astype(np.float64) * tracks.dt_s
    return h00 * p[:, before] + h10 * v[:, before] + h01 * p[:, after] + h11 * v[:, after]
