"""The CSV triples of levelXData: `<nn>_recordingMeta.csv`, `<nn>_tracksMeta.csv`, `<nn>_tracks.csv`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.datasets.sniffing import head, header, matching
from stylesim.datasets.tables import csv_table
from stylesim.errors import InputError
from stylesim.tracks import AgentKind

KINDS = {
    "car": AgentKind.CAR,
    "van": AgentKind.CAR,
    "truck": AgentKind.TRUCK,
    "truck_bus": AgentKind.TRUCK,
    "bus": AgentKind.BUS,
    "trailer": AgentKind.OTHER,
    "motorcycle": AgentKind.MOTORCYCLE,
    "bicycle": AgentKind.BICYCLE,
    "pedestrian": AgentKind.PEDESTRIAN,
}
# Classes that rounD tells apart and inD does not; by them the two, whose columns are the same, are told apart.
ROUND = frozenset({"van", "trailer", "truck", "bus", "motorcycle"})
MIN_RATE_HZ, MAX_RATE_HZ = 5.0, 120.0  # the sets are at 25 Hz (highD, inD, rounD, exiD) and 30 Hz (uniD)
_TRACKS = re.compile(r"^(\d+)_tracks\.csv$")


@dataclass(frozen=True)
class Triple:
    """The three files of one recording."""

    number: str
    tracks: Path

    @property
    def tracks_meta(self) -> Path:
        """The file with one row per road user."""
        return self.tracks.with_name(f"{self.number}_tracksMeta.csv")

    @property
    def recording_meta(self) -> Path:
        """The file with one row in all."""
        return self.tracks.with_name(f"{self.number}_recordingMeta.csv")


def triples(path: Path, name: str) -> list[Triple]:
    """The recordings of a file `<nn>_tracks.csv`, a folder, or its `data` folder, by number.

    InputError where there is none, or one lacks its meta data; `name` is the data set's.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist; give the data folder of {name}")
    files = _track_files(path)
    if not files:
        raise InputError(f"{path} holds no <nn>_tracks.csv; it is no folder of {name}")
    found = [Triple(file.name.split("_")[0], file) for file in files]
    for one in found:
        for meta in (one.tracks_meta, one.recording_meta):
            if not meta.is_file():
                raise InputError(f"{meta} is missing; {one.tracks.name} cannot be read without it")
    return found


def _track_files(path: Path) -> list[Path]:
    files = [f for f in matching(path, "*_tracks.csv", "data/*_tracks.csv") if _TRACKS.match(f.name)]
    return sorted(files, key=lambda f: (len(f.name), f.name))


def first_columns(path: Path) -> set[str]:
    """The columns of the first track file there; empty where there is none. Never raises."""
    files = _track_files(path)
    return set(header(files[0])) if files else set()


def first_classes(path: Path) -> set[str]:
    """The classes in the meta data of the first recording there; never raises."""
    files = _track_files(path)
    if not files:
        return set()
    meta = Triple(files[0].name.split("_")[0], files[0]).tracks_meta
    lines = head(meta, 1 << 18).decode("utf-8", errors="replace").splitlines()
    names = [field.strip() for field in lines[0].split(",")] if lines else []
    if "class" not in names:
        return set()
    at = names.index("class")
    fields = (line.split(",") for line in lines[1:])
    return {row[at].strip().lower() for row in fields if len(row) > at}


def recording_meta(file: Path, numbers: tuple[str, ...], texts: tuple[str, ...] = ()) -> Mapping[str, Any]:
    """The one row of a recording's meta data; InputError where there is none, or no usable frame rate."""
    table = csv_table(file, {**dict.fromkeys(("frameRate", *numbers), pl.Float64), **dict.fromkeys(texts, pl.String)})
    if table.height != 1:
        raise InputError(f"{file} has {table.height} rows; a recording's meta data have one")
    row = table.row(0, named=True)
    if row["frameRate"] is None or not MIN_RATE_HZ <= row["frameRate"] <= MAX_RATE_HZ:
        raise InputError(f"{file}: frameRate is {row['frameRate']}; expected {MIN_RATE_HZ:g} to {MAX_RATE_HZ:g} Hz")
    return row


def classes(file: Path, id_column: str) -> pl.DataFrame:
    """Columns `agent` (text) and `kind` of every road user in the meta data of tracks."""
    table = csv_table(file, {id_column: pl.String, "class": pl.String})
    names = pl.col("class").str.to_lowercase().str.strip_chars()
    known = {name: int(kind) for name, kind in KINDS.items()}
    kind = names.replace_strict(known, default=int(AgentKind.OTHER), return_dtype=pl.Int8)
    return table.select(agent=id_column, kind=kind).unique("agent", keep="first", maintain_order=True)


def with_kinds(table: pl.DataFrame, kinds: pl.DataFrame, dropped: dict[str, int]) -> pl.DataFrame:
    """The rows with their kind; rows of a road user that the meta data do not know are dropped as `unknown_track`."""
    joined = table.join(kinds, on="agent", how="left", maintain_order="left")
    known = joined.filter(pl.col("kind").is_not_null() | pl.col("agent").is_null())
    dropped["unknown_track"] = dropped.get("unknown_track", 0) + joined.height - known.height
    return known.with_columns(pl.col("kind").fill_null(int(AgentKind.OTHER)))
