"""Split-conformal regions for any forecaster: how large a disc about each mode must be to hold the truth.

Vovk, Gammerman, Shafer 2005; Lei et al. 2018 [recalled]. The score of a window is the final displacement to the nearest
of its modes (minFDE), so the region is the union of discs of one radius about the modes. With n scores of drivers who
are exchangeable with the one to come, the ceil((n + 1) (1 - alpha))-th smallest covers him with probability >= 1 -
alpha. One window per calibration driver counts, drawn with the seed, because the windows of one driver are not
exchangeable with those of others. Per group (Mondrian), the promise holds within each group, styles included.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.asking import ask
from stylesim.evaluation.evaluate import common_spec, corpus_facts
from stylesim.evaluation.intervals import MIN_DRIVERS, Estimate, estimate
from stylesim.evaluation.metrics import MODES
from stylesim.evaluation.slices import ALL, CROSS, value_order
from stylesim.evaluation.strata import DRIVER, check_strata, column_of, parts_of, with_strata
from stylesim.forecast import Forecaster
from stylesim.randomness import stream
from stylesim.windows import WindowSpec

ALPHA = 0.1  # chosen: 90 % regions, whose finite-sample correction is small from 30 drivers on
FORMAT = "stylesim-conformal"


@dataclass(frozen=True)
class Region:
    """One group: its own radius, and what both radii cover of the test drivers.

    `radius_m` is NaN where the group has fewer than 30 calibration drivers; then only the pooled radius is held against
    it. A driver's coverage is the share of its test windows whose truth lies in the region.
    """

    group: str
    calibration_drivers: int
    radius_m: float
    coverage: Estimate | None  # by the group's own radius
    pooled_coverage: Estimate  # by the radius of all together

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; None in place of NaN."""
        return {
            "group": self.group,
            "calibration_drivers": self.calibration_drivers,
            "radius_m": self.radius_m if math.isfinite(self.radius_m) else None,
            "coverage": None if self.coverage is None else self.coverage.to_dict(),
            "pooled_coverage": self.pooled_coverage.to_dict(),
        }


@dataclass(frozen=True)
class ConformalReport:
    """Regions of one forecaster; the first row is everybody together."""

    forecaster: str
    by: str
    alpha: float
    regions: tuple[Region, ...]
    about: Mapping[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "format": FORMAT,
            "forecaster": self.forecaster,
            "by": self.by,
            "alpha": self.alpha,
            "regions": [region.to_dict() for region in self.regions],
            "about": dict(self.about),
        }


def conformal_radius(score_m: Float64[np.ndarray, " driver"], alpha: float) -> float:
    """The ceil((n + 1)(1 - alpha))-th smallest score; infinity where n is too small for that promise."""
    rank = math.ceil((len(score_m) + 1) * (1.0 - alpha) - 1e-9)
    return float(np.sort(score_m)[rank - 1]) if rank <= len(score_m) else math.inf


def conformal(
    forecaster: Forecaster,
    corpus: Corpus,
    *,
    by: str = "history:tdbm",
    alpha: float = ALPHA,
    calibrate_on: str = "val",
    test_on: str = "test",
    spec: WindowSpec | None = None,
    seed: int = 0,
    modes: int = MODES,
    progress: Callable[[int, int], None] | None = None,
) -> ConformalReport:
    """Radii from the drivers of one split, coverage measured on those of another, per group of `by` (see `evaluate`).

    Only groups that are known at t0 (scenario, kind, "history:…") can be used by who forecasts; classes of whole
    tracks tell what a style would need. Standing agents are left out, as in `evaluate`. InputError for an alpha
    outside (0, 1), one split for both, an unknown split or stratum, or no calibration driver at all.
    """
    if not 0.0 < alpha < 1.0:
        raise InputError(f"alpha must lie between 0 and 1, not {alpha:g}")
    if calibrate_on == test_on:
        raise InputError(f"regions that are calibrated on {test_on!r} cannot be judged on it; choose another split")
    spec = common_spec([forecaster], spec or WindowSpec())
    check_strata(corpus, (by,))
    known, judged = (
        _scores(forecaster, corpus.split(split), by, spec=spec, modes=modes, progress=progress)
        for split in (calibrate_on, test_on)
    )
    if known.is_empty() or judged.is_empty():
        raise InputError(f"{corpus.path}: no moving driver to calibrate on ({calibrate_on}) or to judge ({test_on})")
    regions, pooled = regions_of(known, judged, alpha=alpha, seed=seed)
    about = {
        "corpus": corpus_facts(corpus), "calibrate_on": calibrate_on, "test_on": test_on, "seed": seed, "modes": modes,
        "history_s": spec.history_s, "future_s": spec.future_s, "stride_s": spec.stride_s, "pooled_radius_m": pooled,
    }  # fmt: skip
    return ConformalReport(forecaster.name, by, alpha, regions, about)


def regions_of(
    known: pl.DataFrame, judged: pl.DataFrame, *, alpha: float = ALPHA, seed: int
) -> tuple[tuple[Region, ...], float]:
    """(regions, everybody first; the pooled radius in metres) from scores that are there.

    Both tables have one row per window of a mover: `unit_id`, `agent_id`, `group`, `score` (its minFDE). Radii come
    from one seeded window of every driver of `known`, coverage from all windows of `judged`.
    """
    one_each = _one_window_each(known, seed)
    pooled = conformal_radius(one_each["score"].to_numpy(), alpha)
    groups = [ALL, *sorted(set(judged["group"].to_list()), key=value_order)]
    return tuple(_region(name, one_each, judged, pooled, alpha=alpha, seed=seed) for name in groups), pooled


def _scores(
    forecaster: Forecaster,
    corpus: Corpus,
    by: str,
    *,
    spec: WindowSpec,
    modes: int,
    progress: Callable[[int, int], None] | None,
) -> pl.DataFrame:
    """One row per window of a mover: unit, agent, group, score."""
    windows, _ = ask(forecaster, corpus, spec=spec, modes=modes, batch=16, progress=progress)
    windows, _ = with_strata(windows.filter(~pl.col("standing")), corpus, (by,))
    columns = [column_of(part) for part in parts_of(by)]
    return windows.select(
        *DRIVER, pl.concat_str(columns, separator=CROSS).alias("group"), pl.col("min_fde_m").alias("score")
    )


def _one_window_each(windows: pl.DataFrame, seed: int) -> pl.DataFrame:
    """One seeded window of every driver, in the order of the drivers."""
    rng = stream(seed, 0, "", "conformal windows")
    shuffled = windows.sort([*DRIVER, "score"]).with_columns(pl.Series("draw", rng.random(windows.height)))
    return shuffled.sort([*DRIVER, "draw"]).unique(list(DRIVER), keep="first", maintain_order=True)


def _region(
    name: str, calibration: pl.DataFrame, judged: pl.DataFrame, pooled: float, *, alpha: float, seed: int
) -> Region:
    own = calibration if name == ALL else calibration.filter(pl.col("group") == name)
    mine = judged if name == ALL else judged.filter(pl.col("group") == name)
    radius = conformal_radius(own["score"].to_numpy(), alpha) if own.height >= MIN_DRIVERS else math.nan
    return Region(
        group=name,
        calibration_drivers=own.height,
        radius_m=radius if math.isfinite(radius) else math.nan,
        coverage=_coverage(mine, radius, f"conformal {name}", seed) if math.isfinite(radius) else None,
        pooled_coverage=_coverage(mine, pooled, f"conformal pooled {name}", seed),
    )


def _coverage(windows: pl.DataFrame, radius_m: float, purpose: str, seed: int) -> Estimate:
    """Mean over drivers of the share of their windows within the radius."""
    per_driver = (
        windows.with_columns((pl.col("score") <= radius_m).cast(pl.Float64).alias("inside"))
        .group_by(list(DRIVER), maintain_order=True)
        .agg(pl.col("inside").mean())
        .sort(list(DRIVER))
    )
    units = per_driver["unit_id"].to_list()
    return estimate(per_driver["inside"].to_numpy(), units, seed=seed, purpose=purpose, rate=True)
