"""From windows to one row per driver: what a labeller judges."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from jaxtyping import Bool, Float64, Int, Int32

from stylesim.errors import InputError
from stylesim.labelers.cuts import FULL_SHARE
from stylesim.labelers.features import FEATURES, WindowFeatures, joint_features, tiled_features, window_features
from stylesim.labelers.options import FeatureOptions
from stylesim.labels import LabelFlag
from stylesim.scene import Scene
from stylesim.tracks import TrackFlag
from stylesim.windows import MIN_HISTORY_S

# Agents times frames that are worked out in one go. Chosen: a few MB for each of the two dozen arrays it takes.
CELLS = 1 << 16
_S_FRONT = FEATURES.index("s_front")
# Said of a driver where it is true of every window that counts; the other flags where it is true of any.
_ALWAYS = LabelFlag.NO_LEADER | LabelFlag.NO_NEIGHBOURS | LabelFlag.NO_LANE


@dataclass(frozen=True, eq=False)
class DriverRows:
    """One row per driver (span "track") or per driver and t0 (span "history"), ready to be scaled and judged."""

    span: str
    length_s: float  # of the windows; chooses the scaler
    scene_id: tuple[str, ...]
    agent_id: tuple[str, ...]
    start_frame: Int32[np.ndarray, " row"]
    stop_frame: Int32[np.ndarray, " row"]
    value: Float64[np.ndarray, "row feature"]  # in the order of FEATURES, NaN where missing
    flags: Int32[np.ndarray, " row"]  # HIGHWAY is the driver's context

    def columns(self, names: Sequence[str]) -> Float64[np.ndarray, "row column"]:
        """The named features."""
        return self.value[:, [FEATURES.index(name) for name in names]]

    def flagged(self, flag: LabelFlag) -> Bool[np.ndarray, " row"]:
        """True for the rows that carry `flag`."""
        return (self.flags & int(flag)) != 0


def track_rows(
    scene: Scene,
    options: FeatureOptions,
    *,
    starts: Sequence[int] | None = None,
    length_steps: int | None = None,
    agents: Int[np.ndarray, " driver"] | None = None,
) -> DriverRows:
    """The mean of each driver's windows: its own, side by side (`starts` None), or those that begin at `starts`.

    Only full windows count; a driver without one is judged by what it has and flagged SHORT. `agents` None: every
    motor vehicle that was seen. The length defaults to `options.window_s`.
    """
    steps = max(1, round(options.window_s / scene.tracks.dt_s)) if length_steps is None else length_steps
    if starts is None:
        windows = tiled_features(scene, steps, options)
    else:
        windows = _side_by_side([window_features(scene, start, steps, options) for start in starts])
    if agents is None:
        agents = np.flatnonzero(scene.tracks.is_motor & scene.tracks.valid.any(axis=1))
    return averaged(scene, windows, agents)


def averaged(scene: Scene, windows: WindowFeatures, agents: Int[np.ndarray, " driver"]) -> DriverRows:
    """The mean of each chosen driver's windows, one row per driver."""
    dt_s = scene.tracks.dt_s
    valid = scene.tracks.valid[agents]
    value, flags = _average(windows.at(agents[:, None], np.arange(windows.frames.shape[1])[None]), dt_s)
    flags[scene.tracks.flagged(TrackFlag.IMPLAUSIBLE)[agents]] |= LabelFlag.IMPLAUSIBLE
    return DriverRows(
        span="track",
        length_s=windows.length_steps * dt_s,
        scene_id=(scene.scene_id,) * len(agents),
        agent_id=tuple(scene.tracks.agent_id[i] for i in agents),
        start_frame=valid.argmax(axis=1).astype(np.int32),
        stop_frame=(valid.shape[1] - valid[:, ::-1].argmax(axis=1)).astype(np.int32),
        value=value,
        flags=flags,
    )


def history_rows(
    scene: Scene,
    starts: Sequence[int],
    length_steps: int,
    options: FeatureOptions,
    *,
    agents: Int[np.ndarray, " driver"] | None = None,
) -> DriverRows:
    """What is known of each driver at each t0 = start + length_steps - 1, from `scene.history` alone.

    A start is negative where the scene is shorter than the history. `agents` None: the motor vehicles seen at t0.
    InputError without starts, or if a t0 is not within the scene.
    """
    if not len(starts):
        raise InputError("no windows to label: give at least one start")
    for t0 in (start + length_steps - 1 for start in starts):
        if not 0 <= t0 < scene.tracks.n_frames:
            raise InputError(
                f"scene {scene.scene_id!r} has frames 0 to {scene.tracks.n_frames - 1}; t0 = {t0} is not one"
            )
    size = max(1, CELLS // max(1, scene.tracks.n_agents * length_steps))
    parts = []
    for _, alike in groupby(starts, key=lambda start: min(start, 0)):  # equally many frames
        group = list(alike)
        for i in range(0, len(group), size):
            parts.append(_history_rows(scene, group[i : i + size], length_steps, options, agents))
    return concatenated(parts)


def _history_rows(
    scene: Scene,
    starts: Sequence[int],
    length_steps: int,
    options: FeatureOptions,
    agents: Int[np.ndarray, " driver"] | None,
) -> DriverRows:
    histories = [scene.history(start + length_steps - 1, length_steps) for start in starts]
    windows = joint_features(histories, options)
    if agents is None:
        at_t0 = np.stack([h.tracks.valid[:, -1] for h in histories])
        window, agent = np.nonzero(at_t0 & scene.tracks.is_motor)
    else:
        window, agent = np.repeat(np.arange(len(starts)), len(agents)), np.tile(agents, len(starts))
    chosen = windows.at(agent[:, None], window[:, None])
    value, flags = _average(chosen, scene.tracks.dt_s)
    flags[chosen.frames[:, 0] < FULL_SHARE * length_steps] |= LabelFlag.SHORT
    start = np.asarray(starts, np.int32)[window]
    return DriverRows(
        span="history",
        length_s=length_steps * scene.tracks.dt_s,
        scene_id=(scene.scene_id,) * len(agent),
        agent_id=tuple(scene.tracks.agent_id[i] for i in agent),
        start_frame=np.maximum(start, 0),
        stop_frame=start + np.int32(length_steps),
        value=value,
        flags=flags,
    )


def concatenated(parts: Sequence[DriverRows]) -> DriverRows:
    """Rows of one span and length, one after the other. ValueError if there is no part or they differ."""
    if len({(p.span, p.length_s) for p in parts}) != 1:
        raise ValueError("rows of one span and one length are wanted")
    return DriverRows(
        span=parts[0].span,
        length_s=parts[0].length_s,
        scene_id=tuple(s for p in parts for s in p.scene_id),
        agent_id=tuple(a for p in parts for a in p.agent_id),
        start_frame=np.concatenate([p.start_frame for p in parts]),
        stop_frame=np.concatenate([p.stop_frame for p in parts]),
        value=np.concatenate([p.value for p in parts]),
        flags=np.concatenate([p.flags for p in parts]),
    )


def _side_by_side(parts: list[WindowFeatures]) -> WindowFeatures:
    if not parts:
        raise InputError("no windows to label: give at least one start")
    return WindowFeatures(
        value=np.concatenate([p.value for p in parts], axis=1),
        frames=np.concatenate([p.frames for p in parts], axis=1),
        highway=np.concatenate([p.highway for p in parts], axis=1),
        flags=np.concatenate([p.flags for p in parts], axis=1),
        length_steps=parts[0].length_steps,
    )


def _average(
    windows: WindowFeatures, dt_s: float
) -> tuple[Float64[np.ndarray, "driver feature"], Int32[np.ndarray, " driver"]]:
    """Mean features and joint flags of the windows that count; NaN for a driver that was seen too shortly."""
    full = windows.full
    long_enough = windows.frames >= max(1, round(MIN_HISTORY_S / dt_s))
    use = np.where(full.any(axis=1, keepdims=True), full, long_enough)
    value = np.where(use[..., None], windows.value, np.nan)
    bits = windows.flags
    with_leader = use & ((bits & LabelFlag.NO_LEADER) == 0)
    # A window without a leader says nothing about the gap that the driver keeps, unless all are such.
    value[..., _S_FRONT] = np.where(with_leader | ~with_leader.any(axis=1, keepdims=True), value[..., _S_FRONT], np.nan)
    flags = np.bitwise_and.reduce(np.where(use, bits, -1), axis=1) & _ALWAYS
    flags |= np.bitwise_or.reduce(np.where(use, bits, 0), axis=1) & ~_ALWAYS
    none = ~use.any(axis=1)
    flags[none] = LabelFlag.SHORT
    highway = np.where(use, windows.highway, np.nan)
    flags[_nanmean(highway[..., None])[:, 0] >= 0.5] |= LabelFlag.HIGHWAY  # most of the frames
    return _nanmean(value), flags.astype(np.int32)


def _nanmean(value: Float64[np.ndarray, "driver window column"]) -> Float64[np.ndarray, "driver column"]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # no window knows it: NaN is the answer
        return np.asarray(np.nanmean(value, axis=1), np.float64)
