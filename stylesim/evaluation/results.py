"""`Evaluation`: what came out of holding one forecaster against one corpus, in memory and on disk."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.corpus.files import json_bytes, write_whole
from stylesim.errors import InputError
from stylesim.evaluation.intervals import Estimate
from stylesim.evaluation.metrics import METRICS
from stylesim.evaluation.slices import ALL, STANDING, Slice

FORMAT = "stylesim-evaluation"
SCHEMA_VERSION = 1
HEADINGS = {
    "min_ade_m": "minADE (m)",
    "min_fde_m": "minFDE (m)",
    "miss_rate": "miss rate",
    "brier_fde_m": "brierFDE (m)",
    "top_fde_m": "top-1 FDE (m)",
}


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One forecaster on one corpus.

    `slices` starts with all moving drivers and those that stand; then one per value of every `by`. `drivers` has one
    row per driver (see `stylesim.evaluation.slices.driver_table`). `about` says what was evaluated and how: corpus
    fingerprint, splits, windows, modes, seed, versions, provenance of the labels. `counts` says what was asked, and
    what was not and why.
    """

    forecaster: str
    by: tuple[str, ...]
    slices: tuple[Slice, ...]
    drivers: pl.DataFrame
    about: Mapping[str, Any]
    counts: Mapping[str, int]

    def slices_by(self, by: str) -> tuple[Slice, ...]:
        """The cells of one stratum; InputError if the evaluation was not cut by it."""
        if by not in (ALL, STANDING, *self.by):
            raise InputError(f"the evaluation of {self.forecaster!r} is not cut by {by!r}; it has {', '.join(self.by)}")
        return tuple(item for item in self.slices if item.by == by)

    @property
    def overall(self) -> Slice:
        """The cell of all moving drivers."""
        return self.slices_by(ALL)[0]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, without the table of drivers."""
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "forecaster": self.forecaster,
            "by": list(self.by),
            "slices": [item.to_dict() for item in self.slices],
            "about": dict(self.about),
            "counts": dict(self.counts),
        }

    def save(self, path: str | Path) -> tuple[Path, Path, Path]:
        """Write `<stem>.json`, `<stem>.md` and `<stem>.parquet` (one row per driver), each whole or not at all.

        `path` may end in one of the three or in none. InputError for another ending; CorpusError for a full disk.
        """
        base = Path(path)
        if base.suffix in (".html", ".htm", ".pdf", ".csv"):
            raise InputError(f"{base}: an evaluation is saved as .json, .md and .parquet; HTML is made by build_report")
        if base.suffix in (".json", ".md", ".parquet"):
            base = base.with_suffix("")
        out = (
            base.with_name(base.name + ".json"),
            base.with_name(base.name + ".md"),
            base.with_name(base.name + ".parquet"),
        )
        buffer = io.BytesIO()
        self.drivers.write_parquet(buffer, compression="zstd", row_group_size=65536)
        write_whole(out[2], buffer.getvalue())
        write_whole(out[1], markdown(self).encode())
        write_whole(out[0], json_bytes(self.to_dict()))
        return out


def load_evaluation(path: str | Path) -> Evaluation:
    """The evaluation that `save` wrote at `<path>.json` and `<path>.parquet`; InputError if it is none."""
    file = Path(path)
    file = file if file.suffix == ".json" or file.is_file() else file.with_name(file.name + ".json")
    table = file.with_suffix(".parquet")
    try:
        raw = json.loads(file.read_text(encoding="utf-8"))
        if raw["format"] != FORMAT or int(raw["schema_version"]) > SCHEMA_VERSION:
            raise InputError(f"{file} is no evaluation that this version of stylesim can read")
        slices = tuple(Slice.from_dict(item) for item in raw["slices"])
        drivers = pl.read_parquet(table)
        return Evaluation(raw["forecaster"], tuple(raw["by"]), slices, drivers, raw["about"], raw["counts"])
    except FileNotFoundError as error:
        raise InputError(f"no such file: {error.filename or table}") from None
    except (ValueError, KeyError, TypeError, AttributeError, pl.exceptions.PolarsError) as error:
        raise InputError(f"{file} (or the .parquet beside it) is no evaluation: {error!r}") from error


def interval_text(value: Estimate, *, digits: int = 2) -> str:
    """`1.63 [1.20, 2.10]`, with the mark "within site" where it is one, or "too few" for a refused cell."""
    if value.refused:
        return "too few"
    mark = " (within site)" if value.status == "within site" else ""
    return f"{value.value:.{digits}f} [{value.low:.{digits}f}, {value.high:.{digits}f}]{mark}"


def _markdown_cell(text: str) -> str:
    return text.replace("\\", "\\\\").replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")


def markdown(evaluation: Evaluation) -> str:
    """The evaluation as Markdown: one table per stratum, n beside every number."""
    about = evaluation.about
    splits = ", ".join(f"{name or 'none'} ({count} scenes)" for name, count in about["corpus"]["splits"].items())
    lines = [
        f"# {_markdown_cell(evaluation.forecaster)} on {_markdown_cell(str(about['corpus']['name']))}",
        "",
        f"Splits: {splits}. "
        f"{about['modes']} modes, {about['history_s']:g} s + {about['future_s']:g} s, 95 % intervals by bootstrap of "
        "units, then drivers. A driver counts once, with the mean of its windows.",
    ]
    for by in (ALL, STANDING, *evaluation.by):
        title = {ALL: "All drivers that move", STANDING: "Drivers that stand (< 1 m in the future)"}.get(by, f"By {by}")
        heads = [by if by in evaluation.by else "cell", "drivers", "units", *(HEADINGS[name] for name in METRICS)]
        lines += ["", f"## {_markdown_cell(title)}", "", f"| {' | '.join(map(_markdown_cell, heads))} |"]
        lines.append("|---" * len(heads) + "|")
        for item in evaluation.slices_by(by):
            size = item.size
            cells = [item.value, str(size.n_drivers), str(size.n_units)]
            cells += [interval_text(item.metrics[name]) for name in METRICS]
            lines.append(f"| {' | '.join(map(_markdown_cell, cells))} |")
    lines += ["", "## What was asked, and what was not", ""]
    lines += [f"* {name}: {count}" for name, count in sorted(evaluation.counts.items())]
    return "\n".join(lines) + "\n"
