"""Times of rows onto frames of a regular clock; what lies on no frame is counted, a file of another rate refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

from stylesim.errors import InputError

OFF_CLOCK_SHARE = 0.2  # chosen: farther than a fifth of a step from every frame, a time belongs to none
# Chosen: a damaged row or two are dropped and counted; a hundredth of a file is another kind of file.
MAX_OFF_CLOCK_SHARE = 0.01
MIN_STEP_S, MAX_STEP_S = 0.005, 2.0  # chosen: 200 Hz to 0.5 Hz; outside of it times are in other units
PHASE_S = 1e-4  # times are written to the millisecond or so


def step_s(table: pl.DataFrame, file: Path) -> float:
    """The step of a table's clock: the commonest time between rows of one agent (columns `agent`, `t` in seconds).

    InputError where there is none between MIN_STEP_S and MAX_STEP_S: times in milliseconds, or no time at all.
    """
    gaps = (
        table.sort("agent", "t")
        .select(gap=pl.col("t").diff().over("agent"))
        .filter((pl.col("gap") > PHASE_S) & pl.col("gap").is_finite())["gap"]
        .to_numpy()
    )
    if not len(gaps):
        raise InputError(f"{file}: no agent has two rows at different times; is the column of times the right one?")
    typical = float(np.median(gaps))
    # The median of a clock such as 0.033, 0.033, 0.034 is a little off: take the mean of what is near it.
    step = float(gaps[np.abs(gaps - typical) < 0.1 * typical].mean())
    if not MIN_STEP_S <= step <= MAX_STEP_S:
        raise InputError(
            f"{file}: rows of one agent are {step:.6g} s apart; expected {MIN_STEP_S} to {MAX_STEP_S} s. "
            "Are the times in other units?"
        )
    return step


def on_frames(table: pl.DataFrame, dt_s: float, file: Path, dropped: dict[str, int]) -> tuple[pl.DataFrame, float]:
    """The rows with `frame` (from 0 on, of the column `t` in seconds), and the time of frame 0.

    Rows without a finite time are dropped as `unreadable`, rows off the clock as `off_clock`. InputError where more
    than MAX_OFF_CLOCK_SHARE are off it.
    """
    before = table.height
    table = table.filter(pl.col("t").is_finite().fill_null(False) & (pl.col("t").abs() < 1e12))
    dropped["unreadable"] = dropped.get("unreadable", 0) + before - table.height
    if table.is_empty():
        return table.with_columns(frame=pl.lit(0, pl.Int64)), 0.0
    t = table["t"].to_numpy()
    phase = _phase(t, dt_s)
    grid = np.round((t - phase) / dt_s)
    off = np.abs(t - phase - grid * dt_s) > OFF_CLOCK_SHARE * dt_s
    dropped["off_clock"] = dropped.get("off_clock", 0) + int(off.sum())
    if off.sum() > max(1, MAX_OFF_CLOCK_SHARE * len(t)):
        raise InputError(
            f"{file}: {int(off.sum())} of {len(t)} rows lie on no clock of {1 / dt_s:.4g} Hz; another rate?"
        )
    first = grid[~off].min()
    frame = pl.Series("frame", (grid - first).astype(np.int64))
    return table.with_columns(frame).filter(pl.Series(~off)), float(phase + first * dt_s)


def _phase(t: np.ndarray, dt_s: float) -> float:
    """What most times leave when divided by the step."""
    left = np.round(np.remainder(t, dt_s) / PHASE_S).astype(np.int64)
    values, counts = np.unique(left, return_counts=True)
    return float(values[counts.argmax()] * PHASE_S)
