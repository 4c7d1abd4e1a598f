"""Errors of one forecast, one value per driver and never a mean over drivers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

MODES = 6  # REFERENCE section 4 [read: UniTraj, AV2]
MISS_THRESHOLD_M = 2.0  # [read: UniTraj, AV2]
METRICS = ("min_ade_m", "min_fde_m", "miss_rate", "brier_fde_m", "top_fde_m")


@dataclass(frozen=True, eq=False)
class ForecastErrors:
    """Errors of each driver; all NaN (and `best_mode` -1) where no future step is known.

    `min_ade_m` and `min_fde_m` are minimised separately; `miss_rate` is 1 where `min_fde_m` is above the threshold,
    else 0; `brier_fde_m` is `min_fde_m + (1 - p)²` with p the probability of `best_mode`, the mode with the least
    final error; `top_fde_m` is the final error of the most probable mode. `best_mode` counts in the given order.
    """

    min_ade_m: Float64[np.ndarray, " driver"]
    min_fde_m: Float64[np.ndarray, " driver"]
    miss_rate: Float64[np.ndarray, " driver"]
    brier_fde_m: Float64[np.ndarray, " driver"]
    top_fde_m: Float64[np.ndarray, " driver"]
    best_mode: Int64[np.ndarray, " driver"]
    best_probability: Float64[np.ndarray, " driver"]


def most_probable(probability: Float[np.ndarray, "driver mode"], k: int) -> Int64[np.ndarray, "driver kept"]:
    """Indices of the k most probable modes of each driver, most probable first; of equals the earlier one."""
    return np.argsort(-probability, axis=1, kind="stable")[:, :k]


def displacement_errors(
    mode_m: Float[np.ndarray, "driver mode time 2"],
    truth_m: Float[np.ndarray, "driver time 2"],
    valid: Bool[np.ndarray, "driver time"],
) -> tuple[Float64[np.ndarray, "driver mode"], Float64[np.ndarray, "driver mode"]]:
    """(ADE, FDE) of every mode: mean over the valid steps, and the error at the last valid step. NaN without one."""
    gap = mode_m.astype(np.float64) - np.where(valid[..., None], truth_m, 0.0)[:, None]
    distance = np.where(valid[:, None], np.hypot(gap[..., 0], gap[..., 1]), 0.0)
    steps = valid.sum(axis=1)
    known = steps > 0
    ade = distance.sum(axis=2) / np.maximum(steps, 1)[:, None]
    last = valid.shape[1] - 1 - valid[:, ::-1].argmax(axis=1)
    fde = np.take_along_axis(distance, last[:, None, None], axis=2)[..., 0]
    return np.where(known[:, None], ade, np.nan), np.where(known[:, None], fde, np.nan)


def forecast_errors(
    mode_m: Float[np.ndarray, "driver mode time 2"],
    probability: Float[np.ndarray, "driver mode"],
    truth_m: Float[np.ndarray, "driver time 2"],
    valid: Bool[np.ndarray, "driver time"] | None = None,
    *,
    k: int = MODES,
    renormalise: bool = False,
    miss_threshold_m: float = MISS_THRESHOLD_M,
) -> ForecastErrors:
    """Errors over the k most probable modes, in metres [read: UniTraj, AV2; equal to av2's functions].

    A forecast with more than k modes keeps its k most probable ones. Their probabilities stay as they are, which is
    the convention of `av2` (`normalize=False`); `renormalise=True` scales them to sum to 1 (`normalize=True`).
    Where two modes have the very same final error, the more probable one is the best mode, so that the order of the
    modes plays no part (`av2` leaves the choice to the caller). Only steps with `valid` count (None: those where the
    truth is finite); the final error is taken at the last of them.

    Raises ValueError where shapes differ or k < 1.
    """
    drivers, modes, steps = mode_m.shape[:3]
    if modes < 1 or k < 1:
        raise ValueError(f"a forecast needs one mode or more, and k >= 1; it has {modes} modes, k = {k}")
    if probability.shape != (drivers, modes) or truth_m.shape != (drivers, steps, 2):
        raise ValueError(f"modes {mode_m.shape}, probabilities {probability.shape} and truth {truth_m.shape} differ")
    finite = np.isfinite(truth_m).all(axis=2)
    mask = finite if valid is None else valid & finite
    order = most_probable(probability, k)
    chance = np.take_along_axis(probability.astype(np.float64), order, axis=1)
    if renormalise:
        chance = chance / chance.sum(axis=1, keepdims=True)
    ade, fde = displacement_errors(np.take_along_axis(mode_m, order[..., None, None], axis=1), truth_m, mask)
    known = mask.any(axis=1)
    best = np.where(known[:, None], fde, 0.0).argmin(
        axis=1
    )  # modes are in order of probability: ties go to the likelier
    row = np.arange(drivers)
    p_best = np.where(known, chance[row, best], np.nan)
    min_fde = fde[row, best]
    return ForecastErrors(
        min_ade_m=ade[row, np.where(known[:, None], ade, 0.0).argmin(axis=1)],
        min_fde_m=min_fde,
        miss_rate=np.where(known, (min_fde > miss_threshold_m).astype(np.float64), np.nan),
        brier_fde_m=min_fde + (1.0 - p_best) ** 2,
        top_fde_m=fde[:, 0],
        best_mode=np.where(known, order[row, best], -1),
        best_probability=p_best,
    )
