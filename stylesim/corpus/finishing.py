"""What the parts of a corpus say together: the scene table, the sums and the checksums of `corpus.json`.

Part after part is looked at and forgotten. What stays is 8 bytes a scene, and the checksums of three files a part.
"""

from __future__ import annotations

import json
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.corpus.table_file import TableFile
from stylesim.errors import CorpusError

SCENE_SCHEMA = {
    "scene_id": pl.String, "unit_id": pl.String, "source": pl.String, "scenario": pl.String,
    "source_scenario_id": pl.String, "official_split": pl.String, "split": pl.String, "start_s": pl.Float64,
    "dt_s": pl.Float64, "n_frames": pl.Int32, "n_agents": pl.Int32, "n_steps": pl.Int64, "t0_frame": pl.Int32,
    "part": pl.Int32, "number": pl.Int32, "road": pl.String, "origin_x_m": pl.Float64, "origin_y_m": pl.Float64,
    "counts": pl.String, "parameters": pl.String, "signals": pl.String, "twin_of": pl.String, "replay_of": pl.String,
    "metadata": pl.String,
}  # fmt: skip
# Of the scene table; chosen: some MB each, for tables of a few rows, as parts give them, take ten times their content.
ROW_GROUP, PART_ROWS = 1 << 12, 1 << 9


@dataclass
class Sums:
    """What `corpus.json` says of all scenes."""

    n_scenes: int = 0
    n_agents: int = 0
    n_steps: int = 0
    dt_s: set[float] = field(default_factory=set)
    counts: Counter[str] = field(default_factory=Counter)
    files: dict[str, str] = field(default_factory=dict)  # sha256 by name

    def add(self, record: Mapping[str, Any]) -> None:
        """Add what the record of a part says."""
        for row in record["scenes"]:
            self.n_scenes += 1
            self.n_agents += row["n_agents"]
            self.n_steps += row["n_steps"]
            self.dt_s.add(row["dt_s"])
            self.counts.update(json.loads(row["counts"]))
        self.files.update(record["files"])


def records_of(partial: Path) -> list[Path]:
    """The records of the parts that are whole, by number (from 100,000 on, names sort otherwise)."""
    return sorted((partial / "records").glob("*.json"), key=lambda path: int(path.stem))


def brought_together(partial: Path, records: Iterable[Path]) -> Sums:
    """Write `scenes.parquet` from the parts' records; the sums over them.

    CorpusError where there is no scene, or two have the same id, or the disk is full.
    """
    records = list(records)
    table = TableFile(partial / "scenes.parquet", row_group=ROW_GROUP, part_rows=PART_ROWS)
    sums, hashes = Sums(), array("Q")
    try:
        for record in _read(records):
            sums.add(record)
            hashes.extend(_hash(row["scene_id"]) for row in record["scenes"])
            table.add(pl.DataFrame(record["scenes"], schema=SCENE_SCHEMA, orient="row"))
        if not sums.n_scenes:
            raise CorpusError(f"{partial}: nothing to write, there is no scene")
        _refuse_twice(partial, records, hashes)
        sums.files["scenes.parquet"] = table.finish()
    finally:
        table.discard()
    return sums


def _read(records: Iterable[Path]) -> Iterator[Mapping[str, Any]]:
    for path in records:
        yield json.loads(path.read_bytes())


def _hash(scene_id: str) -> int:
    return int.from_bytes(blake2b(scene_id.encode(), digest_size=8).digest())


def _refuse_twice(partial: Path, records: Iterable[Path], hashes: array[int]) -> None:
    """CorpusError if a scene_id is there twice. Only ids of equal hashes are compared, in a second look."""
    value, n = np.unique(np.frombuffer(hashes, np.uint64), return_counts=True)
    alike = set(value[n > 1].tolist())
    if not alike:
        return
    ids = (row["scene_id"] for record in _read(records) for row in record["scenes"])
    for scene_id, times in Counter(one for one in ids if _hash(one) in alike).items():
        if times > 1:
            raise CorpusError(f"{partial}: scene_id {scene_id!r} occurs {times - 1} time(s) too often")
