"""Timestamps: a regular clock, or a refusal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from stylesim.errors import InputError

MAX_JITTER = 0.5  # of a step; chosen: farther off, a frame belongs to the next one
MAX_GAP_FRAMES = 36_000  # half an hour at 20 Hz; chosen: a recording with such a hole is two recordings


def refuse_irregular(time_s: Any, dt_s: float, file: Path) -> None:
    """InputError unless the times (in seconds) rise by about `dt_s` from frame to frame.

    Every step must be within half a step of it, and their median within 5 %.
    """
    times = np.asarray(time_s, np.float64)
    if times.ndim != 1 or not np.isfinite(times).all():
        raise InputError(f"{file}: a timestamp is not finite")
    steps = np.diff(times)
    if not len(steps):
        return
    if not ((steps > 0).all() and (np.abs(steps - dt_s) <= MAX_JITTER * dt_s).all()):
        worst = int(np.abs(steps - dt_s).argmax())
        raise InputError(
            f"{file}: timestamps {worst} and {worst + 1} are {steps[worst]:g} s apart, not {dt_s:g} s; "
            "they are damaged, out of order, or of another rate"
        )
    median = float(np.median(steps))
    if abs(median - dt_s) > 0.05 * dt_s:
        raise InputError(f"{file}: frames are {median:g} s apart, not {dt_s:g} s; wrong rate or unit of time")


def frames_of(time_s: Any, dt_s: float, file: Path) -> Any:
    """The frame of each of these ascending times; a clock that drifts slowly is followed, gaps are left out.

    InputError unless every step is a whole number of frames, within a quarter of one.
    """
    times = np.asarray(time_s, np.float64)
    steps = np.diff(times) / dt_s
    whole = np.round(steps)
    if not np.isfinite(times).all() or (np.abs(steps - whole) > MAX_JITTER / 2).any() or (whole < 1).any():
        raise InputError(f"{file}: timestamps lie on no clock of {dt_s:g} s; they are damaged or of another rate")
    if whole.max(initial=1) > MAX_GAP_FRAMES:
        raise InputError(f"{file}: {whole.max() * dt_s:g} s pass between two frames; the timestamps are damaged")
    return np.concatenate([[0], np.cumsum(whole)]).astype(np.int64)
