"""`Experiment`: the finished runs of a folder, and what they say of one arm against another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.errors import InputError, unknown
from stylesim.evaluation.intervals import LEVEL, MIN_DRIVERS, MIN_UNITS
from stylesim.evaluation.seeded import SeededEstimate, seeded_difference, seeded_mean
from stylesim.evaluation.slices import CROSS, LAST, value_order
from stylesim.evaluation.strata import DRIVER, column_of, parts_of
from stylesim.experiments.arms import read_request
from stylesim.experiments.records import Run, read_runs, read_table

METRIC = "min_fde_m"
LEAST = MIN_DRIVERS, MIN_UNITS


@dataclass(frozen=True, eq=False)
class Errors:
    """One metric of one arm: a row per seed, a column per driver that moves."""

    value: Float64[np.ndarray, "seed driver"]
    asked: pl.DataFrame  # unit, driver and number of windows of each column

    @property
    def unit(self) -> tuple[str, ...]:
        """The unit of each driver."""
        return tuple(self.asked["unit_id"].to_list())


@dataclass(frozen=True, eq=False)
class Experiment:
    """Runs of several arms over several seeds; made by `run_experiment`, or read with `Experiment.load`."""

    path: Path
    request: Mapping[str, Any]
    runs: tuple[Run, ...]

    @classmethod
    def load(cls, path: str | Path) -> Experiment:
        """The finished runs of a folder; InputError if it holds no experiment."""
        folder = Path(path)
        runs = sorted(read_runs(folder).values(), key=lambda run: run.key)
        return cls(folder, read_request(folder), tuple(runs))

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of the arms with at least one finished run."""
        return tuple(dict.fromkeys(run.arm for run in self.runs))

    def seeds(self, *arms: str) -> tuple[int, ...]:
        """The seeds with which all of these arms were run. InputError for an arm without any run."""
        for arm in arms:
            if arm not in self.arms:
                raise unknown("arm", arm, self.arms, where=str(self.path))
        sets = [{run.seed for run in self.runs if run.arm == arm} for arm in arms]
        return tuple(sorted(set.intersection(*sets)))

    def measured(self, arm: str, name: str) -> list[Any]:
        """What was measured of every run of an arm, in order of seeds (see `Run.measured`)."""
        return [run.measured[name] for run in self.runs if run.arm == arm]

    def mean(
        self, arm: str, *, metric: str = METRIC, split: str = "test", by: str = "", cell: str = "",
        level: float = LEVEL, seed: int = 0,
    ) -> SeededEstimate:  # fmt: skip
        """Mean of a metric over drivers and seeds; of `cell` of the stratum `by`, or of all drivers that move."""
        errors = self._errors(arm, self.seeds(arm), metric, split, by, cell)
        return seeded_mean(errors.value, errors.unit, seed=seed, purpose=f"{metric} {by} {cell}", level=level)

    def difference(
        self, ours: str, theirs: str, *, metric: str = METRIC, split: str = "test", by: str = "", cell: str = "",
        relative: bool = False, level: float = LEVEL, seed: int = 0,
    ) -> SeededEstimate:  # fmt: skip
        """`ours - theirs`, paired by driver and seed, over the seeds that both were run with; below 0 ours is better.

        `by` and `cell` choose drivers, as strata of `evaluate` ("tdbm", "commanded*scenario"). `relative`: as a share
        of the mean of `theirs`. InputError for an arm, split, stratum or cell that is not there.
        """
        seeds = self.seeds(ours, theirs)
        if not seeds:
            raise InputError(f"{self.path}: {ours!r} and {theirs!r} share no seed")
        a = self._errors(ours, seeds, metric, split, by, cell)
        b = self._errors(theirs, seeds, metric, split, by, cell)
        if not a.asked.equals(b.asked):
            raise InputError(f"{self.path}: {ours!r} and {theirs!r} were asked about different drivers or windows")
        purpose = f"{metric} {by} {cell}"
        return seeded_difference(
            a.value, b.value, a.unit, relative=relative, level=level, seed=seed, purpose=purpose
        )  # fmt: skip

    def cells(self, by: str, *, split: str = "test") -> dict[str, tuple[int, int]]:
        """(drivers, units) of every cell of a stratum, in the order of classes."""
        if not self.runs:
            raise InputError(f"{self.path} has no finished run")
        named = _named(self._table(*self.runs[0].key, split), by)
        sizes = named.group_by("cell").agg(pl.len(), pl.col("unit_id").n_unique().alias("units")).rows()
        return {cell: (n, units) for cell, n, units in sorted(sizes, key=lambda row: value_order(row[0]))}

    def worst(
        self, arm: str, by: str, *, split: str = "val", metric: str = METRIC, least: tuple[int, int] = LEAST
    ) -> str:
        """The cell of `by` in which the arm's mean error is largest, of those with `least` (drivers, units).

        Choose it once, on "val", and follow it on "test". The default is what may be shown; a smaller choice says no
        more than where to look on "test". InputError where no cell has enough drivers and units.
        """
        means = {}
        for cell, (drivers, units) in self.cells(by, split=split).items():
            if drivers >= least[0] and units >= least[1] and cell not in LAST:
                errors = self._errors(arm, self.seeds(arm), metric, split, by, cell)
                means[cell] = float(errors.value.mean())
        if not means:
            raise InputError(f"{self.path}: no cell of {by!r} has {least[0]} drivers of {least[1]} units on {split!r}")
        return max(means, key=lambda cell: means[cell])

    @cached_property
    def _drivers(self) -> dict[tuple[str, int, str], pl.DataFrame]:
        return {}

    def _table(self, arm: str, seed: int, split: str) -> pl.DataFrame:
        """The moving drivers of a run, sorted."""
        key = (arm, seed, split)
        if key not in self._drivers:
            run = next(run for run in self.runs if run.key == (arm, seed))
            self._drivers[key] = read_table(self.path, run, split).filter(pl.col("n_windows") > 0).sort(DRIVER)
        return self._drivers[key]

    def _errors(self, arm: str, seeds: Sequence[int], metric: str, split: str, by: str, cell: str) -> Errors:
        rows, first = [], None
        for seed in seeds:
            table = _chosen(self._table(arm, seed, split), by, cell)
            who = table.select([*DRIVER, "n_windows"])
            first = who if first is None else first
            if not who.equals(first):
                raise InputError(f"{self.path}: runs of {arm!r} were asked about different drivers or windows")
            if metric not in table.columns:
                raise unknown("metric", metric, table.columns)
            rows.append(table[metric].to_numpy().astype(np.float64))
        assert first is not None
        return Errors(np.stack(rows), first)


def _named(table: pl.DataFrame, by: str) -> pl.DataFrame:
    """The table with a column "cell"; InputError where it lacks the stratum."""
    columns = [column_of(part) for part in parts_of(by)]
    for column in columns:
        if column not in table.columns:
            raise InputError(f"the runs have no column {column!r}; label the corpus before the experiment")
    return table.with_columns(pl.concat_str(columns, separator=CROSS).alias("cell"))


def _chosen(table: pl.DataFrame, by: str, cell: str) -> pl.DataFrame:
    if not by:
        return table
    named = _named(table, by)
    known = named["cell"].unique().to_list()
    if cell not in known:
        raise unknown("cell", cell, known, where=f"stratum {by}")
    return named.filter(pl.col("cell") == cell)
