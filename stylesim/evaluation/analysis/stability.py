"""Is a style a trait? Agreement of non-overlapping windows of one driver (the paper assumes one style per driver)."""

from __future__ import annotations

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.evaluation.agreement import quadratic_kappa
from stylesim.evaluation.analysis.judge import DRIVER
from stylesim.evaluation.analysis.measure import Measured
from stylesim.evaluation.analysis.statistics import icc1, kappa, resampled
from stylesim.style import STYLE_CLASSES

CONTEXTS = ("all", "non-highway", "highway")


def stability(one: Measured, *, seed: int) -> pl.DataFrame:
    """ICC(1) of a, and kappa (plain and quadratic) of the class, per length of window and context.

    Windows of one context only; a driver counts once, whatever the number of its windows in kappa: its pairs of
    neighbouring windows together weigh 1. Drivers with one window say nothing and are not counted.
    """
    rows = []
    known = one.windows.filter((pl.col("tdbm") != "undetermined") & ~pl.col("implausible"))
    for length in sorted(set(one.windows["length_s"].to_list())):
        for context in CONTEXTS:
            chosen = known.filter(pl.col("length_s") == length)
            if context != "all":
                chosen = chosen.filter(pl.col("highway") == (context == "highway"))
            chosen = chosen.filter(pl.len().over(list(DRIVER)) >= 2).sort([*DRIVER, "start_s", "scene_id", "window"])
            base = {"corpus": one.name, "window_s": length, "context": context, "n_windows": chosen.height}
            for name, found in _figures(chosen, seed=seed, purpose=f"{one.name} {length:g} {context}").items():
                rows.append(base | {"figure": name, **found})
    return pl.DataFrame(rows, infer_schema_length=None)


def _figures(windows: pl.DataFrame, *, seed: int, purpose: str) -> dict[str, dict[str, float | int | str | None]]:
    sums = windows.group_by(list(DRIVER), maintain_order=True).agg(
        pl.len().cast(pl.Float64).alias("n"),
        pl.col("aggressiveness").sum().alias("total"),
        (pl.col("aggressiveness") ** 2).sum().alias("square"),
        pl.col("tdbm"),
    )
    unit = sums["unit_id"].to_list()
    n, total, square = (sums[c].to_numpy() for c in ("n", "total", "square"))
    table = np.zeros((len(unit), len(STYLE_CLASSES) ** 2))
    for i, styles in enumerate(sums["tdbm"].to_list()):
        places = np.array([STYLE_CLASSES.index(s) for s in styles])
        pairs = places[:-1] * len(STYLE_CLASSES) + places[1:]
        table[i] = np.bincount(pairs, minlength=table.shape[1]) / len(pairs)

    def confusion(weight: Float64[np.ndarray, "draw driver"]) -> Float64[np.ndarray, "draw style style"]:
        return np.asarray((weight @ table).reshape(-1, len(STYLE_CLASSES), len(STYLE_CLASSES)))

    found = {
        "ICC(1) of a": resampled(lambda w: icc1(w, n, total, square), unit, seed=seed, purpose=f"{purpose} icc"),
        "κ of the class": resampled(lambda w: kappa(confusion(w)), unit, seed=seed, purpose=f"{purpose} kappa"),
        "κ, quadratic": resampled(
            lambda w: quadratic_kappa(confusion(w)), unit, seed=seed, purpose=f"{purpose} quadratic"
        ),
    }
    return {name: value.to_dict() for name, value in found.items()}
