"""Track tables in the columns of INTERACTION, which TAF-BW writes too: one CSV of vehicles, one of people."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import polars as pl

from stylesim.datasets.sniffing import header
from stylesim.datasets.table_clock import on_frames
from stylesim.datasets.tables import csv_table
from stylesim.datasets.track_table import Source
from stylesim.errors import InputError
from stylesim.tracks import AgentKind

KINDS = {
    "car": AgentKind.CAR,
    "van": AgentKind.CAR,
    "truck": AgentKind.TRUCK,
    "bus": AgentKind.BUS,
    "motorcycle": AgentKind.MOTORCYCLE,
    "bicycle": AgentKind.BICYCLE,
    "cyclist": AgentKind.BICYCLE,
    "pedestrian": AgentKind.PEDESTRIAN,
    "tricycle": AgentKind.MOTORCYCLE,  # chosen: motorised and narrow
}  # "pedestrian/bicycle" and the rest: OTHER, because the file does not say which
_COLUMNS: dict[str, Any] = {
    "track_id": pl.String,
    "timestamp_ms": pl.Float64,
    "agent_type": pl.String,
    **dict.fromkeys(("x", "y", "vx", "vy"), pl.Float64),
}
_BOX: dict[str, Any] = dict.fromkeys(("psi_rad", "length", "width"), pl.Float64)


def read_tracks(files: list[Path], recording_id: str, dt_s: float) -> tuple[pl.DataFrame, Source, float]:
    """All road users of one recording in standard columns, and the time of frame 0 in the file's seconds."""
    parts = []
    for file in files:
        box = {name: dtype for name, dtype in _BOX.items() if name in header(file)}
        table = csv_table(file, _COLUMNS | box)
        absent = [pl.lit(None, pl.Float64).alias(name) for name in _BOX if name not in box]
        parts.append(table.with_columns(absent).select(*_COLUMNS, *_BOX))
    raw = pl.concat(parts)
    if raw.is_empty():
        raise InputError(f"{files[0]} has no rows")
    kind = pl.col("agent_type").str.to_lowercase().str.strip_chars()
    known = {name: int(k) for name, k in KINDS.items()}
    rider = ~kind.replace_strict(known, default=int(AgentKind.OTHER), return_dtype=pl.Int8).is_in(
        [int(AgentKind.CAR), int(AgentKind.TRUCK), int(AgentKind.BUS), int(AgentKind.MOTORCYCLE)]
    )
    course = pl.arctan2("vy", "vx")
    table = raw.select(
        agent="track_id",
        t=pl.col("timestamp_ms") / 1000.0,
        x="x",
        y="y",
        vx="vx",
        vy="vy",
        # People and riders come without a heading: theirs is where they go.
        heading=pl.when(rider & pl.col("psi_rad").is_null()).then(course).otherwise(pl.col("psi_rad")),
        length="length",
        width="width",
        kind=kind.replace_strict(known, default=int(AgentKind.OTHER), return_dtype=pl.Int8),
    )
    dropped: dict[str, int] = {}
    table, begin = on_frames(table, dt_s, files[0], dropped)
    return table, Source(files[0], recording_id, dt_s, dropped), begin
