"""Any table of tracks (CSV or Parquet) whose columns the user names.

`stylesim read table tracks.csv --map id=track,time=t,x=center_x,y=center_y --unit feet --out …`, or the same in
`tracks.columns.yaml` beside it (see `table_spec`). Without a column of velocities they are differences of positions,
without one of headings they are the direction of travel; both from nothing later than the frame. A column `recording`
tells continuous recordings apart (each is a unit); else the whole table is one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.guarding import bounded, reading
from stylesim.datasets.recording import Recording
from stylesim.datasets.resampling import on_clock
from stylesim.datasets.sniffing import header, listed, matching
from stylesim.datasets.table_clock import on_frames, step_s
from stylesim.datasets.table_spec import SIDECAR, TIME_UNITS, TableSpec, sidecar_of, spec_from_file, spec_from_text
from stylesim.datasets.tables import csv_table
from stylesim.datasets.track_table import Source, recording_of
from stylesim.datasets.user_kinds import kind_of
from stylesim.errors import InputError
from stylesim.scene import Scene

SOURCE = "table"
MAX_RECORDINGS = 100_000  # chosen: more values of the column `recording` mean that it is another column
_TABLES = ("*.csv", "*.csv.gz", "*.parquet", "*.txt")


def scenes(path: str | Path, *, map: str = "", scene_s: float = SCENE_S, **options: str | float) -> Iterator[Scene]:
    """The scenes of a table, or of every table of a folder that has a `.columns.yaml` beside it, by name.

    `map` names the columns ("x=center_x,…"); `options` are the other fields of `TableSpec`. InputError names the
    file, column or option that is missing or wrong.
    """
    root = Path(path)
    given = spec_from_text(map, **options) if map else None
    for table in [root] if root.is_file() else described(root):
        spec = given or spec_from_file(sidecar_of(table))
        for recording, origin in recordings(table, spec):
            yield from cut(
                on_clock(recording),
                source=SOURCE,
                scenario=spec.site,
                unit_id=recording.recording_id,
                origin_m=origin,
                scene_s=scene_s,
            )


def sniff(path: Path) -> bool:
    """True for a table with a `.columns.yaml` beside it, or a folder with one."""
    return any(sidecar_of(file).is_file() for file in matching(path, *_TABLES)[:50])


def described(folder: Path) -> list[Path]:
    """The tables of a folder that say what their columns mean; InputError where there is none."""
    if not folder.is_dir():
        raise InputError(f"{folder} does not exist; give a table of tracks")
    found = [file for file in listed(folder, *_TABLES) if sidecar_of(file).is_file()]
    if not found:
        raise InputError(f"{folder} holds no table with a {SIDECAR} beside it; give one table and map=x=…,y=…")
    return found


def recordings(file: Path, spec: TableSpec) -> Iterator[tuple[Recording, Float64[np.ndarray, " 2"]]]:
    """Each recording of a table with its origin."""
    raw = _standard(_read(bounded(file), spec), spec)
    names = raw["recording"].unique(maintain_order=True).to_list() if "recording" in raw.columns else [None]
    if len(names) > MAX_RECORDINGS:
        raise InputError(f"{file}: {len(names)} values of the column {spec.columns['recording']!r}; no recordings")
    stem = sidecar_of(file).name.removesuffix(SIDECAR)
    for name in names:
        part = raw if name is None and len(names) == 1 else raw.filter(pl.col("recording").eq_missing(pl.lit(name)))
        recording_id = f"{SOURCE}_{stem}" if len(names) == 1 else f"{SOURCE}_{stem}_{str(name)[:100]}"
        dropped: dict[str, int] = {}
        if "t" in part.columns:
            dt_s = 1.0 / spec.rate_hz if spec.rate_hz else step_s(part, file)
            part, _ = on_frames(part, dt_s, file, dropped)
        else:
            dt_s = 1.0 / (spec.rate_hz or math.nan)
        yield recording_of(part, Source(file, recording_id, dt_s, dropped), front=spec.position == "front")


def _read(file: Path, spec: TableSpec) -> pl.DataFrame:
    """The named columns, numbers as numbers."""
    texts = {"id", "kind", "recording"}
    wanted = {
        column: pl.String if texts & {t for t, c in spec.columns.items() if c == column} else pl.Float64
        for column in dict.fromkeys(spec.columns.values())
    }
    if file.name.endswith(".parquet"):
        with reading(file, "Parquet table"):
            table = pl.scan_parquet(file)
            names = table.collect_schema().names()
            _need(file, list(wanted), names)
            return table.select(pl.col(n).cast(dtype, strict=False) for n, dtype in wanted.items()).collect()
    _need(file, list(wanted), list(header(file, spec.separator)))
    return csv_table(file, wanted, separator=spec.separator)


def _need(file: Path, wanted: list[str], names: list[str]) -> None:
    absent = [name for name in wanted if name not in names]
    if absent:
        raise InputError(f"{file} has no column {', '.join(absent)}; it has: {', '.join(names)[:300] or 'none'}")


def _standard(raw: pl.DataFrame, spec: TableSpec) -> pl.DataFrame:
    """Standard columns in metres, m/s and radians; `t` in seconds or `frame`."""
    columns = spec.columns
    up = 1.0 if spec.y_axis == "up" else -1.0
    factors = {
        "x": spec.metres, "y": up * spec.metres, "length": spec.metres, "width": spec.metres,
        "vx": spec.metres_per_second, "vy": up * spec.metres_per_second, "speed": spec.metres_per_second,
    }  # fmt: skip
    made = {name: pl.col(columns[name]) * factor for name, factor in factors.items() if name in columns}
    made["agent"] = pl.col(columns["id"])
    if "heading" in columns:
        made["heading"] = _angle(pl.col(columns["heading"]), spec.angle) * up
    if "time" in columns:
        made["t"] = pl.col(columns["time"]) * TIME_UNITS[spec.time_unit]
    else:
        frame = pl.col(columns["frame"])
        whole = frame.is_finite() & (frame.abs() < 1e12) & ((frame - frame.round(0)).abs() < 1e-6)
        made["frame"] = pl.when(whole).then(frame).round(0).cast(pl.Int64)
    if "recording" in columns:
        made["recording"] = pl.col(columns["recording"])
    table = raw.select(**made)
    if "kind" not in columns:
        return table.with_columns(kind=pl.lit(int(kind_of(spec.kind)), pl.Int8))
    texts = raw[columns["kind"]]
    kinds = {text: int(kind_of(text, strict=False)) for text in texts.unique().to_list() if text is not None}
    known = texts.replace_strict(kinds, default=0, return_dtype=pl.Int8) if kinds else pl.Series([0] * len(texts))
    return table.with_columns(known.cast(pl.Int8).alias("kind"))


def _angle(value: pl.Expr, unit: str) -> pl.Expr:
    if unit == "radians":
        return value
    return value.radians() if unit == "degrees" else math.pi / 2 - value.radians()
