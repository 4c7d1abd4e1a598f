"""Who is forecast worst, by how much, and how much worse the whole gets when rare drivers become common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.evaluation.intervals import DRAWS, LEVEL, Estimate, bootstrap_means, bootstrap_weights, status_of
from stylesim.evaluation.metrics import METRICS
from stylesim.evaluation.slices import ALL, LAST, Slice, driver_means
from stylesim.evaluation.strata import column_of, parts_of
from stylesim.evaluation.stress_corpora import EVERYDAY, RARE
from stylesim.evaluation.stress_windows import POPULATION
from stylesim.randomness import stream

WORST_BY = "min_fde_m"
_TAIL = 100 * (1.0 - LEVEL) / 2


@dataclass(frozen=True)
class WorstGroup:
    """The cell of the largest minFDE among those that may be shown, and its distance to the mean of everybody.

    It was chosen on the same drivers, so `gap_m` is rather too large; `among` says of how many it is the worst.
    """

    value: str
    among: int
    error_m: Estimate
    gap_m: Estimate  # its mean minus the mean of all drivers, resampled together
    ratio: float

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "value": self.value, "among": self.among, "ratio_to_average": self.ratio,
            "min_fde_m": self.error_m.to_dict(), "gap_to_average_m": self.gap_m.to_dict(),
        }  # fmt: skip


def worst_group(moving: pl.DataFrame, cells: tuple[Slice, ...], by: str, *, seed: int) -> WorstGroup | None:
    """The worst of `cells` (of the stratum `by`); None where fewer than two may be shown.

    Cells of whom nobody commanded or could judge are no group.
    """
    shown = [
        one for one in cells if not one.size.refused and not any(part in LAST for part in one.value.split(" × "))
    ]  # fmt: skip
    if len(shown) < 2:
        return None
    worst = max(shown, key=lambda one: one.metrics[WORST_BY].value)
    columns = tuple(column_of(part) for part in parts_of(by))
    drivers = driver_means(moving, columns)
    error = drivers[WORST_BY].to_numpy()
    named = drivers.select(pl.concat_str(columns, separator=" × "))
    inside = (named.to_series() == worst.value).to_numpy().astype(np.float64)
    units = np.unique(np.asarray(drivers["unit_id"].to_list(), dtype=str), return_inverse=True)[1].astype(np.int64)
    mean = float(error.mean())
    gaps = []
    for weight in bootstrap_weights(units, stream(seed, 0, "", f"gap {by} {worst.value}"), DRAWS):
        own = weight @ inside
        with np.errstate(invalid="ignore", divide="ignore"):
            gaps.append(weight @ (inside * error) / own - weight @ error / weight.sum(axis=1))
    low, high = np.nanpercentile(np.concatenate(gaps), [_TAIL, 100 - _TAIL])
    size = worst.metrics[WORST_BY]
    gap = Estimate(size.value - mean, float(low), float(high), size.n_drivers, size.n_units, size.status)
    return WorstGroup(worst.value, len(shown), size, gap, size.value / mean)


@dataclass(frozen=True)
class Degradation:
    """One scenario (or "all", every scenario weighing the same): rare_heavy minus naturalistic, per metric."""

    scenario: str
    everyday: Mapping[str, float]
    rare: Mapping[str, float]
    change: Mapping[str, Estimate]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; None in place of NaN."""
        return {
            "scenario": self.scenario,
            EVERYDAY: {name: _plain(value) for name, value in self.everyday.items()},
            RARE: {name: _plain(value) for name, value in self.rare.items()},
            "change": {name: value.to_dict() for name, value in self.change.items()},
        }


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None


def degradation(moving: pl.DataFrame, *, seed: int) -> tuple[Degradation, ...]:
    """Per scenario, and over all of them with equal weight; () without both populations.

    Both populations drove the same scenarios; means are compared within each, their episodes resampled independently.
    `change.n_drivers` is the smaller population's, over all scenarios their sum (refused: the least).
    """
    if {EVERYDAY, RARE} - set(moving[POPULATION].unique()):
        return ()
    found: list[Degradation] = []
    draws: dict[str, list[Float64[np.ndarray, " draw"]]] = {name: [] for name in METRICS}
    for scenario in sorted(moving["scenario"].unique()):
        sides = {
            name: driver_means(moving.filter((pl.col("scenario") == scenario) & (pl.col(POPULATION) == name)))
            for name in (EVERYDAY, RARE)
        }
        change: dict[str, Estimate] = {}
        for metric in METRICS:
            change[metric], drawn = _change(sides, metric, f"{scenario} {metric}", seed)
            draws[metric].append(drawn)
        means = {name: {m: _mean(side, m) for m in METRICS} for name, side in sides.items()}
        found.append(Degradation(scenario, means[EVERYDAY], means[RARE], change))
    over = {metric: _together([one.change[metric] for one in found], draws[metric]) for metric in METRICS}
    everyday, rare = (
        {m: float(np.mean([getattr(one, side)[m] for one in found])) for m in METRICS} for side in ("everyday", "rare")
    )
    return (Degradation(ALL, everyday, rare, over), *found)


def _mean(drivers: pl.DataFrame, metric: str) -> float:
    return float(drivers[metric].to_numpy().mean()) if drivers.height else float("nan")


def _change(
    sides: Mapping[str, pl.DataFrame], metric: str, purpose: str, seed: int
) -> tuple[Estimate, Float64[np.ndarray, " draw"]]:
    n = min(side.height for side in sides.values())
    units = min(side["unit_id"].n_unique() for side in sides.values())
    status = status_of(n, units)
    if status == "too few":
        return Estimate(np.nan, np.nan, np.nan, n, units, status), np.full(DRAWS, np.nan)
    drawn = []
    for name, side in sides.items():
        group = np.unique(np.asarray(side["unit_id"].to_list(), dtype=str), return_inverse=True)[1].astype(np.int64)
        rng = stream(seed, 0, "", f"degradation {name} {purpose}")
        drawn.append(
            bootstrap_means(side[metric].to_numpy(), group if status == "general" else np.zeros_like(group), rng)
        )
    gap = drawn[1] - drawn[0]
    low, high = np.percentile(gap, [_TAIL, 100 - _TAIL])
    value = _mean(sides[RARE], metric) - _mean(sides[EVERYDAY], metric)
    return Estimate(value, float(low), float(high), n, units, status), gap


def _together(parts: list[Estimate], draws: list[Float64[np.ndarray, " draw"]]) -> Estimate:
    """The mean over scenarios; refused where one of them is, and no more general than the least general."""
    n, units = min(part.n_drivers for part in parts), min(part.n_units for part in parts)
    status = status_of(n, units)
    if status == "too few":
        return Estimate(np.nan, np.nan, np.nan, n, units, status)
    n, units = sum(part.n_drivers for part in parts), sum(part.n_units for part in parts)
    low, high = np.percentile(np.mean(draws, axis=0), [_TAIL, 100 - _TAIL])
    return Estimate(float(np.mean([part.value for part in parts])), float(low), float(high), n, units, status)
