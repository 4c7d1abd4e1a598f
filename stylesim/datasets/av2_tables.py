"""The table of an Argoverse 2 scenario: checked, sorted by track and time, what was dropped counted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Bool, Float64, Int64

from stylesim.datasets.plausible import MAX_DISTANCE_M, MAX_SPEED_MPS
from stylesim.errors import InputError

N_FRAMES = 110
_NUMBERS = ("position_x", "position_y", "heading", "velocity_x", "velocity_y")
_IDS = ("track_id", "object_type", "timestep")
_SINGLE = ("scenario_id", "city", "focal_track_id")
_COLUMNS: dict[str, Any] = {
    "track_id": pl.String,
    "object_type": pl.String,
    "timestep": pl.Int64,
    **dict.fromkeys(_NUMBERS, pl.Float64),
    **dict.fromkeys(_SINGLE, pl.String),
}


@dataclass(frozen=True, eq=False)
class AvTable:
    """The usable rows of a scenario, one per (agent, frame), and what stands once in the file."""

    scenario_id: str
    city: str
    focal_track_id: str
    agent_id: tuple[str, ...]
    object_type: tuple[str, ...]  # of each agent's first row
    agent: Int64[np.ndarray, " row"]
    frame: Int64[np.ndarray, " row"]
    numbers: Float64[np.ndarray, "row 5"]  # x, y, heading, vx, vy
    rows_in: int
    dropped: dict[str, int]


def table_of(file: Path) -> AvTable:
    """The table in that file. InputError where it is damaged, lacks a column, or holds no usable row.

    Dropped: `unreadable` (a value is missing or not finite), `implausible` (no frame of a scenario, faster than
    MAX_SPEED_MPS, or farther than MAX_DISTANCE_M from the middle), `duplicate` (a second row of a track in a frame).
    """
    table = _read(file)
    single = [_once(table, name, file) for name in _SINGLE]
    numbers = np.stack([np.asarray(table[name].to_numpy(), np.float64) for name in _NUMBERS], -1)
    steps = table["timestep"]
    frame = (steps.fill_null(-1) if steps.null_count() else steps).to_numpy().astype(np.int64)
    readable = np.isfinite(numbers).all(axis=1)
    for name in _IDS:
        if table[name].null_count():
            readable &= table[name].is_not_null().to_numpy()
    kept: Bool[np.ndarray, " row"] = readable & _plausible(numbers, frame, np.asarray(readable))
    if not kept.any():
        raise InputError(f"{file} has no usable row")
    rows = np.flatnonzero(kept)
    names, agent = _agents(table["track_id"], rows)
    key = agent * N_FRAMES + frame[rows]
    if not (np.diff(key) > 0).all():
        _, once = np.unique(key, return_index=True)
        rows, agent = rows[once], agent[once]
    begins = np.searchsorted(agent, np.arange(len(names)))
    return AvTable(
        scenario_id=single[0],
        city=single[1],
        focal_track_id=single[2],
        agent_id=tuple(names),
        object_type=tuple(str(kind) for kind in table["object_type"][rows[begins].tolist()]),
        agent=agent,
        frame=frame[rows],
        numbers=numbers[rows],
        rows_in=table.height,
        dropped={
            "unreadable": int((~readable).sum()),
            "implausible": int((readable & ~kept).sum()),
            "duplicate": len(key) - len(rows),
        },
    )


def _agents(track_id: pl.Series, rows: Int64[np.ndarray, " row"]) -> tuple[list[str], Int64[np.ndarray, " row"]]:
    """The ids of the tracks in those rows, in their order as text, and to which of them each row belongs."""
    starts = np.ones(len(track_id), bool)  # rows of one track stand together: a name is looked at once
    changes = track_id.slice(1) != track_id.slice(0, len(track_id) - 1)
    starts[1:] = (changes.fill_null(True) if changes.null_count() else changes).to_numpy()
    run = (np.cumsum(starts) - 1)[rows]
    runs = np.unique(run)
    found = [str(name) for name in track_id[np.flatnonzero(starts)[runs].tolist()]]
    names = sorted(set(found))
    number = {name: i for i, name in enumerate(names)}
    code = np.zeros(int(run.max()) + 1, np.int64)
    code[runs] = [number[name] for name in found]
    return names, code[run]


def _plausible(
    numbers: Float64[np.ndarray, "row 5"], frame: Int64[np.ndarray, " row"], readable: Bool[np.ndarray, " row"]
) -> Bool[np.ndarray, " row"]:
    middle = [np.median(numbers[readable, axis]) for axis in (0, 1)] if readable.any() else np.zeros(2)
    with np.errstate(invalid="ignore", over="ignore"):
        slow = np.hypot(numbers[:, 3], numbers[:, 4]) <= MAX_SPEED_MPS
        near = (np.abs(numbers[:, :2] - middle) <= MAX_DISTANCE_M).all(axis=1)
    return slow & near & (frame >= 0) & (frame < N_FRAMES) & (np.abs(numbers[:, 2]) < 1e4)


def _once(table: pl.DataFrame, name: str, file: Path) -> str:
    """What stands in every row of that column."""
    column = table[name]
    if column.n_unique() > 1:
        raise InputError(f"{file} holds {column.n_unique()} values of {name}; a scenario has one")
    value = column[0] if len(column) else None
    if value is None and name == "scenario_id":
        raise InputError(f"{file} has no scenario_id, or no row")
    return str(value or "")


def _read(file: Path) -> pl.DataFrame:
    """The columns that are needed, in their types. One thread: a file is small, and starting others costs more."""
    try:
        raw = file.read_bytes()
        try:
            table = pl.read_parquet(raw, columns=list(_COLUMNS), parallel="none", use_statistics=False)
        except pl.exceptions.ColumnNotFoundError:
            schema = pl.read_parquet_schema(raw)
            absent = ", ".join(name for name in _COLUMNS if name not in schema)
            raise InputError(f"{file} lacks the columns {absent}; it is no scenario of Argoverse 2") from None
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = (str(error).splitlines() or ["unreadable"])[0]
        raise InputError(f"{file} is damaged or no Parquet file ({reason}); get it again") from error
    if dict(table.schema) == _COLUMNS:
        return table
    try:
        return table.select(pl.col(name).cast(dtype) for name, dtype in _COLUMNS.items())
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{file} has a column of the wrong type ({str(error).splitlines()[0]})") from error
