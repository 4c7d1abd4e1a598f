"""Shares that are a ratio of two sums over drivers, with the interval of units, then drivers, resampled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from stylesim.evaluation.intervals import DRAWS, LEVEL, Estimate, bootstrap_weights, status_of
from stylesim.randomness import stream


def ratio_estimate(
    above: Float64[np.ndarray, " driver"],
    below: Float64[np.ndarray, " driver"],
    unit: Sequence[str],
    *,
    seed: int,
    purpose: str,
    draws: int = DRAWS,
) -> Estimate:
    """sum(above) / sum(below) over drivers; refused under 30 drivers, "within site" with fewer than 3 units.

    NaN with NaN ends where the denominators add up to 0. ValueError where a value is not finite.
    """
    if not (np.isfinite(above).all() and np.isfinite(below).all()):
        raise ValueError(f"{purpose}: a driver's value is not finite")
    names, group = np.unique(np.asarray(unit, dtype=str), return_inverse=True)
    status = status_of(len(above), len(names))
    if status == "too few" or below.sum() == 0:
        return Estimate(np.nan, np.nan, np.nan, len(above), len(names), "too few")
    rng = stream(seed, 0, "", f"bootstrap ratio {purpose}")
    groups = (group if status == "general" else np.zeros(len(above))).astype(np.int64)
    with np.errstate(invalid="ignore", divide="ignore"):
        drawn = [(weight @ above) / (weight @ below) for weight in bootstrap_weights(groups, rng, draws)]
    tail = 100 * (1.0 - LEVEL) / 2
    low, high = np.nanpercentile(np.concatenate(drawn), [tail, 100 - tail])
    return Estimate(float(above.sum() / below.sum()), float(low), float(high), len(above), len(names), status)
