"""Do mode probabilities mean what they say? Reliability of "this mode ends nearest to the truth", and its error.

Every one of the modes is a claim with a probability, and exactly one of a window's comes true: the one whose end is
nearest to the truth. Claims are gathered by their probability; the expected calibration error is the mean distance
between what was claimed and how often it came true, weighted by the claims (Naeini, Cooper, Hauskrecht 2015
[recalled]). A forecaster of one mode claims 1 and is always right: it has nothing to calibrate, and none is reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.evaluation.intervals import DRAWS, LEVEL, Estimate, bootstrap_weights, status_of
from stylesim.evaluation.strata import DRIVER
from stylesim.randomness import stream

BINS = 10  # the usual number [recalled]; probabilities of six modes crowd in the lower ones


@dataclass(frozen=True, eq=False)
class Reliability:
    """One group: claims per bin of probability (drivers weigh alike), mean claim, how often true, and the error."""

    group: str
    weight: Float64[np.ndarray, " bin"]  # share of the claims
    claimed: Float64[np.ndarray, " bin"]  # NaN in an empty bin
    came_true: Float64[np.ndarray, " bin"]
    error: Estimate

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; None in place of NaN."""
        plain = {name: [None if np.isnan(v) else float(v) for v in getattr(self, name)] for name in _COLUMNS}
        return {"group": self.group, **plain, "expected_calibration_error": self.error.to_dict()}


_COLUMNS = ("weight", "claimed", "came_true")


def reliability(windows: pl.DataFrame, *, group: str, seed: int, modes: int) -> Reliability | None:
    """Reliability of the windows of movers (`asking.WINDOW_SCHEMA`); None where every forecast has one mode.

    A driver counts once, with the mean of its windows. The interval resamples units, then drivers; with few claims the
    error is too large on average, because chance alone parts a bin's claim from its outcome.
    """
    if windows.is_empty() or windows["mode_probability"].list.len().max() == 1:
        return None
    drivers = windows.select(DRIVER).unique(maintain_order=True).sort(DRIVER).with_row_index("driver")
    indexed = windows.join(drivers, on=list(DRIVER), maintain_order="left")
    row = indexed["driver"].to_numpy().astype(np.int64)
    each = 1.0 / np.bincount(row)[row]
    best = indexed["best_probability"].to_numpy()
    claims = indexed.select("driver", pl.col("mode_probability").list.head(modes)).with_columns(pl.Series("w", each))
    claims = claims.explode("mode_probability")
    said = claims["mode_probability"].to_numpy().astype(np.float64)
    n = drivers.height
    place = claims["driver"].to_numpy().astype(np.int64) * BINS + _bin(said)
    made = np.bincount(place, claims["w"].to_numpy(), n * BINS).reshape(n, BINS)
    mass = np.bincount(place, claims["w"].to_numpy() * said, n * BINS).reshape(n, BINS)
    true = np.bincount(row * BINS + _bin(best), each, n * BINS).reshape(n, BINS)
    total = made.sum(axis=0)
    with np.errstate(invalid="ignore"):
        claimed, came_true = mass.sum(axis=0) / total, true.sum(axis=0) / total
    error = _error(made, mass, true, drivers["unit_id"].to_list(), group, seed)
    return Reliability(group, total / total.sum(), claimed, came_true, error)


def _bin(probability: Float64[np.ndarray, " claim"]) -> np.ndarray:
    return np.minimum((probability * BINS).astype(np.int64), BINS - 1)


def _error(
    made: Float64[np.ndarray, "driver bin"],
    mass: Float64[np.ndarray, "driver bin"],
    true: Float64[np.ndarray, "driver bin"],
    unit: list[str],
    group: str,
    seed: int,
) -> Estimate:
    """Sum over bins of |claimed - came true| as shares of all claims, with its bootstrap interval."""
    names, index = np.unique(np.asarray(unit, dtype=str), return_inverse=True)
    status = status_of(len(unit), len(names))
    if status == "too few":
        return Estimate(np.nan, np.nan, np.nan, len(unit), len(names), status)
    value = float(np.abs(mass.sum(axis=0) - true.sum(axis=0)).sum() / made.sum())
    rng = stream(seed, 0, "", f"reliability {group}")
    groups = index if status == "general" else np.zeros(len(unit))
    draws = [
        np.abs(weight @ (mass - true)).sum(axis=1) / (weight @ made).sum(axis=1)
        for weight in bootstrap_weights(groups.astype(np.int64), rng, DRAWS)
    ]
    tail = 100 * (1.0 - LEVEL) / 2
    low, high = np.percentile(np.concatenate(draws), [tail, 100 - tail])
    return Estimate(value, float(low), float(high), len(unit), len(names), status)
