"""`compare`: two evaluations or two stress tests of the same questions, side by side; differences are paired."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.errors import InputError
from stylesim.evaluation.compare import differences
from stylesim.evaluation.intervals import Estimate, paired_difference
from stylesim.evaluation.results import Evaluation, load_evaluation
from stylesim.evaluation.slices import ALL, value_order
from stylesim.evaluation.strata import DRIVER
from stylesim.evaluation.stress_compare import Figure, figures_beside
from stylesim.evaluation.stress_decisions import CUTS, KINDS, MEASURES
from stylesim.evaluation.stress_results import SUFFIX, load_decisions, load_stress

FORMAT = "stylesim-comparison"
SCHEMA_VERSION = 1
_ONE = ("scene_id", "agent_id", "unit_id", "t0_frame", "kind", "taken")  # what names a decision


@dataclass(frozen=True, eq=False)
class Comparison:
    """`ours` minus `theirs` on the same windows of the same drivers; below 0 `ours` is better (errors, misses, Brier).

    `cells` by stratum ("all" first), value and metric. For two stress tests: `decisions` by (kind, cut), value and
    measure, where above 0 is better for all but the Brier score, and `figures`, which are not paired: both beside each
    other, each with its own interval.
    """

    ours: Evaluation
    theirs: Evaluation
    cells: Mapping[str, Mapping[str, Mapping[str, Estimate]]]
    decisions: Mapping[tuple[str, str], Mapping[str, Mapping[str, Estimate]]]
    figures: tuple[Figure, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "ours": self.ours.forecaster,
            "theirs": self.theirs.forecaster,
            "cells": {by: _plain(values) for by, values in self.cells.items()},
            "decisions": [
                {"kind": kind, "by": by, "cells": _plain(values)} for (kind, by), values in self.decisions.items()
            ],
            "figures": [one.to_dict() for one in self.figures],
            "about": dict(self.ours.about),
        }


def _plain(values: Mapping[str, Mapping[str, Estimate]]) -> dict[str, Any]:
    return {value: {name: one.to_dict() for name, one in metrics.items()} for value, metrics in values.items()}


def compare(ours: str | Path, theirs: str | Path, *, by: str | None = None, seed: int = 0) -> Comparison:
    """Two files that `evaluate` (.json) or `stress` (.stress.json) wrote, their .parquet files beside them.

    By every stratum that both have, or by the one given. Raises InputError for a file that is none, two of different
    kinds, two that were not asked the same, or a stratum that one lacks.
    """
    stressed = [Path(path).name.endswith(SUFFIX) for path in (ours, theirs)]
    if stressed[0] != stressed[1]:
        raise InputError(f"{ours} and {theirs}: one is a stress test ({SUFFIX}) and the other an evaluation (.json)")
    if all(stressed):
        raw = [load_stress(path) for path in (ours, theirs)]
    a, b = (load_evaluation(_evaluation(path)) for path in (ours, theirs))
    shared = [name for name in a.by if name in b.by]
    if by is not None and by not in shared:
        raise InputError(f"--by: {by!r} is not in both evaluations; they share {', '.join(shared) or 'none'}")
    cells = {stratum: differences(a, b, stratum, seed=seed) for stratum in (ALL, *(shared if by is None else [by]))}
    if not all(stressed):
        return Comparison(a, b, cells, {}, ())
    tables = [load_decisions(path) for path in (ours, theirs)]
    return Comparison(a, b, cells, decision_differences(*tables, seed=seed), figures_beside(*raw))


def _evaluation(path: str | Path) -> Path:
    file = Path(path)
    return file.with_name(file.name.removesuffix(SUFFIX) + ".json") if file.name.endswith(SUFFIX) else file


def decision_differences(
    ours: pl.DataFrame, theirs: pl.DataFrame, *, seed: int
) -> dict[tuple[str, str], dict[str, dict[str, Estimate]]]:
    """`ours - theirs` per kind and cut, value and measure, a driver counting once; InputError for other decisions."""
    a, b = (table.sort(_ONE) for table in (ours, theirs))
    if not a.select(_ONE).equals(b.select(_ONE)):
        raise InputError("the two stress tests asked about different decisions; they cannot be compared")
    both = a.with_columns(pl.lit(ALL).alias(ALL), **{f"their {m}": b[m] for m in MEASURES})
    found: dict[tuple[str, str], dict[str, dict[str, Estimate]]] = {}
    for kind in KINDS:
        own = both.filter(pl.col("kind") == kind)
        if own.is_empty():
            continue
        for by in CUTS:
            values = sorted(own[by].unique().to_list(), key=value_order)
            found[kind, by] = {value: _cell(own.filter(pl.col(by) == value), kind, by, value, seed) for value in values}
    return found


def _cell(rows: pl.DataFrame, kind: str, by: str, value: str, seed: int) -> dict[str, Estimate]:
    names: Sequence[str] = (*MEASURES, *(f"their {m}" for m in MEASURES))
    drivers = rows.group_by(list(DRIVER)).agg(pl.col(names).mean()).sort(DRIVER)
    units = drivers["unit_id"].to_list()
    return {
        name: paired_difference(
            drivers[name].to_numpy(), drivers[f"their {name}"].to_numpy(), units, seed=seed,
            purpose=f"decisions {kind} {by} {value} {name}",
        )
        for name in MEASURES
    }  # fmt: skip
