"""How styles are distributed: class shares, margins, who had no neighbours, and the shift from part to part."""

from __future__ import annotations

import numpy as np
import polars as pl
from jaxtyping import Bool, Float64

from stylesim.evaluation.analysis.measure import Measured
from stylesim.evaluation.analysis.parts import TRAIN, held_out_of
from stylesim.evaluation.analysis.statistics import resampled
from stylesim.evaluation.intervals import MIN_UNITS, Estimate, estimate, status_of
from stylesim.evaluation.label_summary import FRAGILE_MARGIN
from stylesim.style import STYLE_CLASSES

ORIENTATIONS = {"printed": "tdbm", "transposed": "tdbm_transposed"}
NAMES = (*STYLE_CLASSES, "undetermined")


def class_shares(one: Measured, *, seed: int) -> pl.DataFrame:
    """Share of each class among the drivers, both orientations, with intervals (REFERENCE section 1)."""
    rows = []
    unit = one.drivers["unit_id"].to_list()
    for orientation, column in ORIENTATIONS.items():
        style = one.drivers[column].to_numpy()
        for name in NAMES:
            found = estimate(
                (style == name).astype(np.float64), unit, seed=seed, purpose=f"{one.name} {column} {name}", rate=True
            )
            count = int((style == name).sum())
            rows.append(
                {"corpus": one.name, "orientation": orientation, "class": name, "count": count, **found.to_dict()}
            )
    return pl.DataFrame(rows, infer_schema_length=None)


def firmness(one: Measured, *, seed: int) -> pl.DataFrame:
    """Shares of drivers without neighbours, leader or lane, of clamped features and of thin margins; margin quartiles.

    What "no neighbours" does to the class is said by the share of "threatening" and "careful" among those drivers.
    """
    drivers, unit = one.drivers, one.drivers["unit_id"].to_list()
    thin = (pl.col("margin") < FRAGILE_MARGIN).fill_null(False)
    said = {
        "no neighbours": drivers["no_neighbours"],
        "no leader": drivers["no_leader"],
        "no lane": drivers["no_lane"],
        "a feature clamped": drivers["clamped"],
        f"margin under {FRAGILE_MARGIN}": drivers.select(thin).to_series(),
    }
    rows = []
    for name, holds in said.items():
        found = estimate(holds.to_numpy().astype(np.float64), unit, seed=seed, purpose=f"{one.name} {name}", rate=True)
        rows.append({"corpus": one.name, "figure": name, **found.to_dict()})
    margin = drivers["margin"].drop_nulls().to_numpy()
    for name, q in (("lower quartile", 25), ("median", 50), ("upper quartile", 75)):
        value = float(np.percentile(margin, q)) if len(margin) else None
        units = drivers["unit_id"].n_unique()
        status = status_of(len(margin), units)
        rows.append({"corpus": one.name, "figure": f"margin, {name}", "value": value, "low": None, "high": None,
                     "n_drivers": len(margin), "n_units": units, "status": status})  # fmt: skip
    alone = drivers.filter(pl.col("no_neighbours"))
    for orientation, column in ORIENTATIONS.items():
        for style in ("threatening", "careful"):
            found = estimate(
                (alone[column].to_numpy() == style).astype(np.float64),
                alone["unit_id"].to_list(),
                seed=seed,
                purpose=f"{one.name} alone {column} {style}",
                rate=True,
            )
            figure = f"{style} among those without neighbours, {orientation}"
            rows.append({"corpus": one.name, "figure": figure, **found.to_dict()})
    return pl.DataFrame(rows, infer_schema_length=None)


def share_shift(one: Measured, *, seed: int) -> pl.DataFrame:
    """Class share in each held-out part minus in the training part; refused where either part is too small."""
    rows = []
    parts = set(one.drivers["part"].to_list())
    for other in held_out_of(parts):
        both = one.drivers.filter(pl.col("part").is_in([TRAIN, other]))
        ours = (both["part"] == other).to_numpy()
        unit = both["unit_id"].to_list()
        for orientation, column in ORIENTATIONS.items():
            style = both[column].to_numpy()
            for name in NAMES:
                hit = (style == name).astype(np.float64)
                found = _shift(hit, ours, unit, seed=seed, purpose=f"shift {one.name} {other} {column} {name}")
                rows.append({
                    "corpus": one.name, "parts": one.parts, "part": other, "orientation": orientation, "class": name,
                    "n_train": int((~ours).sum()), "n_part": int(ours.sum()), **found.to_dict(),
                })  # fmt: skip
    return pl.DataFrame(rows, infer_schema_length=None)


def _shift(
    hit: Float64[np.ndarray, " driver"],
    ours: Bool[np.ndarray, " driver"],
    unit: list[str],
    *,
    seed: int,
    purpose: str,
) -> Estimate:
    """The difference of two shares; each part must be large enough by itself."""
    units = [len({u for u, mine in zip(unit, side, strict=True) if mine}) for side in (ours, ~ours)]
    sizes = [int(side.sum()) for side in (ours, ~ours)]
    if "too few" in (status_of(n, u) for n, u in zip(sizes, units, strict=True)):
        return Estimate(np.nan, np.nan, np.nan, min(sizes), min(units), "too few")

    if np.ptp(hit) == 0:  # nobody, or everybody, on both sides: resampling says nothing of how far it could be
        status = "general" if min(units) >= MIN_UNITS else "within site"
        return Estimate(0.0, np.nan, np.nan, len(hit), len(set(unit)), status)  # type: ignore[arg-type]

    def difference(
        weight: Float64[np.ndarray, "draw driver"],
    ) -> Float64[np.ndarray, " draw"]:
        first, second = (
            weight[:, side] @ hit[side] / np.maximum(weight[:, side].sum(axis=1), 1e-9) for side in (ours, ~ours)
        )
        return np.asarray(first - second)

    return resampled(difference, unit, seed=seed, purpose=purpose)
