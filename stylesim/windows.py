"""Which (agent, t0) of a scene are asked of a forecaster, and which frames its history has."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int32

from stylesim.errors import InputError
from stylesim.scene import Scene

MIN_HISTORY_S = 1.0  # REFERENCE: style_cond from >= 1 s of history, else the null token


@dataclass(frozen=True)
class WindowSpec:
    """Lengths of history and future in seconds, and the distance of one t0 from the next.

    The default is Argoverse 2's 5 s + 6 s, whose sum is the 11 s window of the track labels. `stride_s`
    chosen: half a future, so that neighbouring samples overlap but are not near-copies.
    """

    history_s: float = 5.0
    future_s: float = 6.0
    stride_s: float = 3.0

    def __post_init__(self) -> None:
        """InputError unless every length is a positive number."""
        for name in ("history", "future", "stride"):
            seconds = getattr(self, f"{name}_s")
            if not (math.isfinite(seconds) and seconds > 0):
                raise InputError(f"the {name} of a window must be a positive number of seconds, not {seconds:g}")

    def steps(self, dt_s: float) -> tuple[int, int, int]:
        """(history, future, stride) in frames; history counts the frame t0 itself."""
        return (
            max(1, round(self.history_s / dt_s)),
            max(1, round(self.future_s / dt_s)),
            max(1, round(self.stride_s / dt_s)),
        )


def anchor_frames(scene: Scene, spec: WindowSpec) -> list[int]:
    """The frames t0 of a scene: the one that its source fixes, else every stride with a whole future left.

    The first t0 has a whole history behind it; an agent that appeared later has a shorter one.
    """
    history, future, stride = spec.steps(scene.tracks.dt_s)
    last = scene.tracks.n_frames - 1 - future
    if scene.t0_frame is not None:
        return [scene.t0_frame] if scene.t0_frame <= last else []
    return list(range(history - 1, last + 1, stride))


def earlier_scene(scene: Scene, t0: int, history_steps: int, earlier_s: float) -> Scene | None:
    """What was known of a scene when the history began, at most `earlier_s` of it; None where it began then."""
    last = t0 - history_steps
    steps = round(earlier_s / scene.tracks.dt_s)
    return scene.history(last, steps) if last >= 0 and steps > 0 else None


def target_agents(scene: Scene, t0: int, spec: WindowSpec, *, need_future: bool = True) -> Int32[np.ndarray, " driver"]:
    """Motor vehicles that are known at t0 and MIN_HISTORY_S before it and (`need_future`) to the end of the future.

    The commanded style, the labels and the outcome play no part in the choice. History frames whose
    interpolation reaches across t0 do not count.
    """
    history, future, _ = spec.steps(scene.tracks.dt_s)
    known = scene.tracks.history(t0, history).valid
    least = min(history, max(1, round(MIN_HISTORY_S / scene.tracks.dt_s)))
    chosen = scene.tracks.is_motor & known[:, -1] & (known[:, -least:].sum(axis=1) >= least)
    if need_future:
        chosen &= scene.tracks.valid[:, t0 + 1 : t0 + 1 + future].all(axis=1)
    return np.flatnonzero(chosen).astype(np.int32)
