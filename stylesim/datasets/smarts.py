"""SMARTS traffic histories (SQLite, `*.shf`): what SMARTS made of NGSIM, INTERACTION and other sources.

Opened read-only. Positions are centres in metres; headings are counter-clockwise from +y [read from the files, and the
convention of SMARTS], here from +x. Lights, where the table has any, are states at stop points and are not linked to
lanes. There is no map in the file. One file is one unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.guarding import reading
from stylesim.datasets.light_logs import held_log
from stylesim.datasets.recording import SignalLog
from stylesim.datasets.resampling import on_clock
from stylesim.datasets.sniffing import matching
from stylesim.datasets.sqlite_files import has_tables, opened
from stylesim.datasets.table_clock import on_frames, step_s
from stylesim.datasets.track_table import Source, recording_of
from stylesim.errors import InputError
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind

SOURCE = "smarts"
# Vehicle types as SMARTS numbers them [read: its history generator]; 1 motorcycle, 2 car, 3 truck are NGSIM's own.
KINDS = {
    1: AgentKind.MOTORCYCLE,
    2: AgentKind.CAR,
    3: AgentKind.TRUCK,
    4: AgentKind.PEDESTRIAN,
}
STATES = {0: SignalState.UNKNOWN, 1: SignalState.RED, 2: SignalState.YELLOW, 3: SignalState.GREEN}
STALE_S = 5.0  # chosen: several steps of the logs that SMARTS makes
_TRACKS = """SELECT t.vehicle_id, t.sim_time, t.position_x, t.position_y, t.heading_rad, t.speed,
    v.type, v.length, v.width FROM Trajectory t LEFT JOIN Vehicle v ON v.id = t.vehicle_id"""
_NEEDED = {
    "Trajectory": {"vehicle_id", "sim_time", "position_x", "position_y", "heading_rad", "speed"},
    "Vehicle": {"id", "type", "length", "width"},
}


def scenes(path: str | Path, *, scene_s: float = SCENE_S) -> Iterator[Scene]:
    """The scenes of a history, or of every `*.shf` of a folder, by name.

    InputError names the file that is missing, damaged, or in other units.
    """
    root = Path(path)
    files = [root] if root.is_file() else sorted(root.glob("*.shf"))
    if not files:
        raise InputError(f"{root} holds no *.shf; give a traffic history of SMARTS")
    for file in files:
        name = f"{SOURCE}_{file.stem}"
        rows, lights = _read(file)
        dt_s = step_s(rows, file)
        dropped: dict[str, int] = {}
        table, begin = on_frames(rows, dt_s, file, dropped)
        recording, origin = recording_of(table, Source(file, name, dt_s, dropped), signals=_lights(lights, begin))
        yield from cut(
            on_clock(recording),
            source=SOURCE,
            scenario=file.stem,
            unit_id=name,
            origin_m=origin,
            scene_s=scene_s,
            unit_start_s=0.0,
        )


def sniff(path: Path) -> bool:
    """True for an SQLite file with the ending of a history, or a folder with one."""
    return any(has_tables(file, _NEEDED) for file in matching(path, "*.shf"))


def _read(file: Path) -> tuple[pl.DataFrame, list[tuple[Any, ...]]]:
    """Rows of the tracks, and (time, state, x, y, lane) of the lights."""
    with reading(file, "traffic history of SMARTS"), opened(file, _NEEDED) as database:
        for table, needed in _NEEDED.items():
            columns = {row[1] for row in database.execute(f"PRAGMA table_info({table})")}
            if not needed <= columns:
                raise InputError(f"{file}: its table {table} lacks {', '.join(sorted(needed - columns))}")
        rows = database.execute(_TRACKS).fetchall()
        query = "SELECT sim_time, state, stop_point_x, stop_point_y, lane FROM TrafficLightState"
        lights = database.execute(query).fetchall() if has_tables(file, ("TrafficLightState",)) else []
        if not rows:
            raise InputError(f"{file} has no rows in its table Trajectory")
        return _table(rows), lights


def _table(rows: list[tuple[Any, ...]]) -> pl.DataFrame:
    """Standard columns; what is no number becomes null, so that it is counted."""
    columns: list[list[Any]] = [list(column) for column in zip(*rows, strict=True)]
    names = ("agent", "t", "x", "y", "heading", "speed", "type", "length", "width")
    numbers = {
        name: pl.Series(name, [_number(v) for v in column], pl.Float64)
        for name, column in zip(names[1:], columns[1:], strict=True)
    }
    kinds = {float(code): int(kind) for code, kind in KINDS.items()}
    agent = pl.Series("agent", [None if v is None else str(v)[:100] for v in columns[0]], pl.String)
    table = pl.DataFrame([agent, *numbers.values()])
    kind = pl.col("type").replace_strict(kinds, default=int(AgentKind.OTHER), return_dtype=pl.Int8)
    return table.with_columns(kind=kind, heading=pl.col("heading") + math.pi / 2).drop("type")


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def _lights(rows: list[tuple[Any, ...]], begin_s: float) -> SignalLog | None:
    """A light is a stop point of a lane, named by both."""
    sound = [row for row in rows if all(_number(v) is not None for v in (row[0], row[2], row[3]))]
    if not sound:
        return None

    return held_log(
        np.array([row[0] for row in sound], np.float64) - begin_s,
        [f"{row[4]}@{row[2]:.1f},{row[3]:.1f}" for row in sound],
        [STATES.get(row[1], SignalState.UNKNOWN) for row in sound],
        stale_s=STALE_S,
    )
