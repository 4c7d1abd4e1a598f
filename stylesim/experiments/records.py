"""The runs of an experiment on disk: one line of JSON and one table of drivers per split for every finished run."""

from __future__ import annotations

import io
import json
import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.corpus.files import storage_error, write_whole
from stylesim.errors import InputError

RUNS_FILE = "runs.jsonl"


@dataclass(frozen=True)
class Run:
    """One arm trained with one seed and evaluated. `measured` has what it cost, its steps and parameters."""

    arm: str
    seed: int
    facts: Mapping[str, Any]
    measured: Mapping[str, Any]

    @property
    def key(self) -> tuple[str, int]:
        """What no two runs of a folder share."""
        return self.arm, self.seed


def table_file(out: Path, arm: str, seed: int, split: str) -> Path:
    """Where the drivers of a run are."""
    return out / "drivers" / f"{arm}.{seed}.{split}.parquet"


def write_run(out: Path, run: Run, tables: Mapping[str, pl.DataFrame]) -> None:
    """The tables (by split), then the line that says that they are there; CorpusError for a full disk."""
    for split, table in tables.items():
        buffer = io.BytesIO()
        table.write_parquet(buffer, compression="zstd")
        write_whole(table_file(out, run.arm, run.seed, split), buffer.getvalue())
    content = {"arm": run.arm, "seed": run.seed, "facts": dict(run.facts), "measured": dict(run.measured)}
    line = json.dumps(content, sort_keys=True, allow_nan=False) + "\n"
    path = out / RUNS_FILE
    try:
        with path.open("ab+") as file:
            # a line that a killed process left unfinished must not swallow this one
            if file.tell() and not _ends_line(file):
                line = "\n" + line
            file.write(line.encode())  # one write in append mode: two processes do not mix their lines
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise storage_error(error, path) from error


def _ends_line(file: io.BufferedRandom) -> bool:
    file.seek(-1, os.SEEK_END)
    return file.read(1) == b"\n"


def read_runs(out: Path) -> dict[tuple[str, int], Run]:
    """The finished runs; a line cut short by a kill is not one, and is warned of. InputError for other content."""
    path = out / RUNS_FILE
    if not path.exists():
        return {}
    found: dict[tuple[str, int], Run] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        if not line:
            continue
        try:
            raw = json.loads(line)
        except ValueError:
            warnings.warn(f"{path}, line {number}: cut short; that run is made again", stacklevel=2)
            continue
        try:
            run = Run(str(raw["arm"]), int(raw["seed"]), dict(raw["facts"]), dict(raw["measured"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}, line {number} is no run of an experiment: {error!r}") from None
        found[run.key] = run
    return found


def read_table(out: Path, run: Run, split: str) -> pl.DataFrame:
    """The drivers of a run; InputError if the file is missing or damaged."""
    path = table_file(out, run.arm, run.seed, split)
    try:
        return pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        first = (str(error).splitlines() or [""])[0]
        raise InputError(f"{path} cannot be read ({first}); is {split!r} a split of this experiment?") from None
