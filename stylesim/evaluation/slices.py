"""From windows to drivers to cells: a driver counts once, with the mean of its windows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import polars as pl

from stylesim.evaluation.intervals import Estimate, estimate
from stylesim.evaluation.metrics import METRICS
from stylesim.evaluation.strata import DRIVER, column_of, parts_of
from stylesim.style import STYLE_CLASSES

ALL = "all"  # `by` of the cell that holds every moving driver
STANDING = "standing"  # `by` of the cell that holds the agents that stand in the future
CROSS = " × "

_ORDER = {name: i for i, name in enumerate((*STYLE_CLASSES, "normal", "neutral"))}
LAST = ("undetermined", "unlabelled", "not commanded")


@dataclass(frozen=True)
class Slice:
    """One cell: its estimate of every metric. All share `n_drivers`, `n_units` and whether they are refused."""

    by: str
    value: str
    n_windows: int
    metrics: dict[str, Estimate]

    @property
    def size(self) -> Estimate:
        """Any of the estimates, for what they share: `n_drivers`, `n_units`, `status`, `refused`."""
        return self.metrics[METRICS[0]]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        cells = {name: value.to_dict() for name, value in self.metrics.items()}
        return {"by": self.by, "value": self.value, "n_windows": self.n_windows, "metrics": cells}

    @classmethod
    def from_dict(cls, raw: dict[str, Any]) -> Slice:
        """The inverse of `to_dict`."""
        cells = {name: Estimate.from_dict(value) for name, value in raw["metrics"].items()}
        return cls(raw["by"], raw["value"], int(raw["n_windows"]), cells)


def value_order(value: str) -> tuple[tuple[int, str], ...]:
    """Sorting key: classes from aggressive to timid, then other names, then what could not be judged."""
    return tuple(
        (len(_ORDER) + 1 + LAST.index(part) if part in LAST else _ORDER.get(part, len(_ORDER)), part)
        for part in value.split(CROSS)
    )


def driver_means(windows: pl.DataFrame, columns: tuple[str, ...] = ()) -> pl.DataFrame:
    """One row per driver (and per value of `columns`): the mean of its windows in every metric."""
    keys = [*DRIVER, *columns]
    means = [pl.col(name).mean() for name in METRICS]
    return windows.group_by(keys, maintain_order=True).agg(pl.len().alias("n_windows"), *means).sort(keys)


def cell(windows: pl.DataFrame, *, by: str, value: str, seed: int, within_site: bool) -> Slice:
    """The estimates of one cell."""
    drivers = driver_means(windows)
    units = drivers["unit_id"].to_list()
    metrics = {
        name: estimate(
            drivers[name].to_numpy(),
            units,
            seed=seed,
            purpose=f"{by} {value} {name}",
            rate=name == "miss_rate",
            within_site=within_site,
        )
        for name in METRICS
    }
    return Slice(by, value, windows.height, metrics)


def all_slices(windows: pl.DataFrame, by: tuple[str, ...], *, seed: int, within_site: bool) -> tuple[Slice, ...]:
    """The cell of all moving drivers, of those that stand, and of every value of every `by` (moving only)."""
    moving = windows.filter(~pl.col("standing"))
    found = [cell(moving, by=ALL, value=ALL, seed=seed, within_site=within_site)]
    standing = windows.filter(pl.col("standing"))
    found.append(cell(standing, by=STANDING, value=STANDING, seed=seed, within_site=within_site))
    for item in by:
        columns = [column_of(part) for part in parts_of(item)]
        named = moving.with_columns(pl.concat_str(columns, separator=CROSS).alias("cell"))
        for value in sorted(named["cell"].unique().to_list(), key=value_order):
            chosen = named.filter(pl.col("cell") == value)
            found.append(cell(chosen, by=item, value=value, seed=seed, within_site=within_site))
    return tuple(found)


def driver_table(windows: pl.DataFrame) -> pl.DataFrame:
    """One row per driver for the Parquet file: who, where, errors, probabilities, both style columns.

    Errors are means over the windows in which it moves (null if it never does), `standing_min_fde_m` over the others;
    `style_cond_*` is the class of the history in most of its windows, `style_strat_*` the class of the whole track;
    `mode_probability` is the mean over windows of the k-th most probable mode's probability.
    """
    styles = [name for name in windows.columns if name.startswith(("style_strat_", "style_cond_"))]
    moving, keys = ~pl.col("standing"), list(DRIVER)
    first = [pl.col(name).first() for name in ("source", "scenario", "kind", "commanded")]
    errors = [pl.col(name).filter(moving).mean() for name in (*METRICS, "best_probability")]
    table = windows.group_by(keys, maintain_order=True).agg(
        *first,
        pl.col("scene_id").unique(maintain_order=True),
        *[pl.col(name).mode().sort().first() for name in styles],
        moving.sum().alias("n_windows"),
        pl.col("standing").sum().alias("n_standing"),
        *errors,
        pl.col("min_fde_m").filter(pl.col("standing")).mean().alias("standing_min_fde_m"),
        top_probability=pl.col("mode_probability").list.first().filter(moving).mean(),
    )
    ranked = (
        windows.filter(moving)
        .select(*keys, "mode_probability")
        .with_columns(pl.int_ranges(pl.col("mode_probability").list.len()).alias("rank"))
        .explode("mode_probability", "rank")
        .group_by([*keys, "rank"])
        .agg(pl.col("mode_probability").mean())
        .sort([*keys, "rank"])
        .group_by(keys, maintain_order=True)
        .agg(pl.col("mode_probability"))
    )
    return table.join(ranked, on=keys, how="left", maintain_order="left").sort(keys)
