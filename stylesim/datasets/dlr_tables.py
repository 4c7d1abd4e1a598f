"""The CSV tables of DLR Urban Traffic and DLR Highway Traffic, checked and turned into a `Recording`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float64, Int8

from stylesim.datasets import plausible
from stylesim.datasets.dlr_lights import signal_log
from stylesim.datasets.recording import Recording, SignalLog, lookahead_of
from stylesim.datasets.stamps import Stamp
from stylesim.datasets.tables import csv_table, microseconds
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.tracks import MOTOR_KINDS, AgentKind

STEP_US = 50_000  # 20 Hz [read from the file: exactly 50 ms between frames]
# Chosen: a fifth of a step. A time farther from the grid belongs to no frame.
OFF_CLOCK_US = 10_000
# Chosen: a damaged row or two are dropped and counted; a hundredth of a file is another kind of file.
MAX_OFF_CLOCK_SHARE = 0.01
STAMP_SLACK_US = 2_000_000  # the name gives whole seconds; tracks may overlap it a little
# Chosen: below this the classifier of the source does not say what it is; 1 of 211 tracks in the shipped file.
MIN_CLASS_PROBABILITY = 0.4
STANDING_MPS = 1.0  # chosen: a vehicle last seen slower than this did not drive out of view: its id was lost

_NUMBERS = (
    "center_easting", "center_northing", "velocity_easting", "velocity_northing", "yaw",
    "dimension_length", "dimension_width",
)  # fmt: skip
_CLASSES = {
    "classifications_pedestrian": AgentKind.PEDESTRIAN,
    "classifications_bicycle": AgentKind.BICYCLE,
    "classifications_motorbike": AgentKind.MOTORCYCLE,
    "classifications_car": AgentKind.CAR,
    "classifications_van": AgentKind.CAR,  # a van is driven like a car; its share is added to the car's [ours]
    "classifications_truck": AgentKind.TRUCK,
}
_COLUMNS: dict[str, Any] = {
    "timestamp": pl.String,
    "id": pl.String,  # about 1.7e15: never through a float
    **dict.fromkeys((*_NUMBERS, *_CLASSES), pl.Float64),
    "interpolated": pl.Boolean,
}


def recording_from(
    tracks: Path, lights: Path | None, stamp: Stamp | None, *, source: str = "dlr_ut"
) -> tuple[Recording, int]:
    """The recording in `tracks`, and the time of its frame 0 in UTC microseconds; `source` begins its name.

    Dropped and counted: `unreadable` (a number, time or flag that is none), `outside_recording` (not between the
    times in the file's name), `off_clock` (on no frame), `duplicate` (a second row of an agent in a frame),
    `implausible` (not in UTM metres, or faster than any road user). InputError where the file as a whole is wrong.
    """
    table = csv_table(tracks, _COLUMNS).with_columns(microseconds("timestamp").alias("t"))
    dropped: dict[str, int] = {}
    table = _kept(table, pl.all_horizontal(_readable()), "unreadable", dropped)
    if stamp is not None:
        first, last = stamp.begin_us - STAMP_SLACK_US, stamp.end_us + STAMP_SLACK_US
        table = _kept(table, pl.col("t").is_between(first, last), "outside_recording", dropped)
    if table.is_empty():
        lost = ", ".join(f"{n} {reason}" for reason, n in dropped.items() if n)
        raise InputError(f"{tracks} has no usable row" + (f": {lost}" if lost else ""))
    table, begin = _on_clock(table, tracks, dropped)
    plausible.whole_file(table, tracks)
    table = _kept(table, plausible.row() & plausible.nearby(table), "implausible", dropped)
    if table.is_empty():
        raise InputError(f"{tracks}: none of its {dropped['implausible']} rows can be a road user in metres")
    rows = table.height
    table = table.unique(["id", "frame"], keep="first", maintain_order=True).sort("id", "frame")
    dropped["duplicate"] = rows - table.height
    log = None if lights is None else signal_log(lights, begin)
    name = f"{source}_{stamp.text if stamp else tracks.name.split('.')[0]}"
    return _recording(name, table, log, dropped), begin


def _kept(table: pl.DataFrame, condition: pl.Expr, reason: str, dropped: dict[str, int]) -> pl.DataFrame:
    kept = table.filter(condition)
    dropped[reason] = table.height - kept.height
    return kept


def _readable() -> list[pl.Expr]:
    numbers = [pl.col(name).is_finite().fill_null(False) for name in (*_NUMBERS, *_CLASSES)]
    return [pl.col(name).is_not_null() for name in ("t", "id", "interpolated")] + numbers


def _on_clock(table: pl.DataFrame, tracks: Path, dropped: dict[str, int]) -> tuple[pl.DataFrame, int]:
    """The rows that lie on the grid most of them share, with their frame; and the time of frame 0."""
    phase = int(table.select((pl.col("t") % STEP_US).mode().min()).item())
    grid = (pl.col("t") - phase + STEP_US // 2) // STEP_US
    table = table.with_columns(grid.alias("grid"))
    rows = table.height
    table = _kept(table, (pl.col("t") - phase - pl.col("grid") * STEP_US).abs() <= OFF_CLOCK_US, "off_clock", dropped)
    if dropped["off_clock"] > MAX_OFF_CLOCK_SHARE * rows:
        raise InputError(f"{tracks}: {dropped['off_clock']} of {rows} rows lie on no clock of 20 Hz; other rate?")
    first = int(table.select(pl.col("grid").min()).item())
    return table.with_columns((pl.col("grid") - first).alias("frame")), first * STEP_US + phase


def _recording(name: str, table: pl.DataFrame, log: SignalLog | None, dropped: dict[str, int]) -> Recording:
    ids, agent = np.unique(table["id"].to_numpy(), return_inverse=True)
    frame = table["frame"].to_numpy().astype(np.int64)
    first = np.searchsorted(agent, np.arange(len(ids)))  # first row of each agent: what is known when it appears
    velocity = table.select("velocity_easting", "velocity_northing").to_numpy()
    kind = _kinds(table.select(*_CLASSES).to_numpy()[first])
    size = table.select("dimension_length", "dimension_width").to_numpy()[first]
    last = np.append(first[1:], len(agent)) - 1
    slow = np.hypot(*velocity[last].T) < STANDING_MPS
    ended_early = frame[last] < frame.max() - 1_000_000 // STEP_US
    return Recording(
        recording_id=name,
        agent_id=tuple(str(i) for i in ids),
        kind=kind,
        size_m=size.astype(np.float32),
        agent=agent.astype(np.int64),
        frame=frame,
        position_m=table.select("center_easting", "center_northing").to_numpy(),
        velocity_mps=velocity,
        heading_rad=wrap_angle(np.radians(table["yaw"].to_numpy())),
        lookahead=lookahead_of(agent.astype(np.int64), frame, table["interpolated"].to_numpy()),
        dt_s=STEP_US / 1e6,
        signals=log,
        dropped=dropped,
        notes={
            "tracks": len(ids),
            "rows_interpolated": int(table["interpolated"].sum()),
            "tracks_ended_standing": int((np.isin(kind, [int(k) for k in MOTOR_KINDS]) & slow & ended_early).sum()),
        },
    )


def _kinds(probability: Float64[np.ndarray, "agent label"]) -> Int8[np.ndarray, " agent"]:
    """The likeliest kind of each agent; OTHER where the source's classifier is not sure."""
    kinds = np.array([int(k) for k in _CLASSES.values()])
    known = np.unique(kinds)
    share = np.stack([probability[:, kinds == k].sum(axis=1) for k in known], axis=1)
    sure = share.max(axis=1, initial=0.0) >= MIN_CLASS_PROBABILITY
    return np.where(sure, known[share.argmax(axis=1)], int(AgentKind.OTHER)).astype(np.int8)
