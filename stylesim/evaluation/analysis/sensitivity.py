"""How far the classes rest on the smoother, the window and the scaler: the same drivers, measured and judged anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.analysis.judge import DRIVER, JUDGED, Judge, with_tdbm
from stylesim.evaluation.analysis.measure import frame_of, per_driver
from stylesim.evaluation.analysis.statistics import kappa
from stylesim.evaluation.intervals import MIN_DRIVERS
from stylesim.kinematics import Smoother
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.rows import track_rows
from stylesim.labelers.tdbm import TDBM
from stylesim.style import STYLE_CLASSES

# Chosen: about a third less and half as much again, as in the fidelity figures.
MEASURES: dict[str, Callable[[FeatureOptions], FeatureOptions]] = {
    "smoother 0.7 s": lambda o: replace(o, smoother=Smoother(length_s=0.7)),
    "smoother 1.7 s": lambda o: replace(o, smoother=Smoother(length_s=1.7)),
    "windows of 7 s": lambda o: replace(o, window_s=7.0),
    "windows of 16 s": lambda o: replace(o, window_s=16.0),
}
SCENES = 40  # chosen: at most so many scenes are measured anew, spread evenly over the corpus
VALUES = ("same_class", "kappa", "a_change", "largest_shift")


def sensitivity(
    corpus: Corpus,
    name: str,
    judge: Judge,
    others: dict[str, TDBM],
    *,
    progress: Callable[[int, int], None] | None = None,
) -> pl.DataFrame:
    """For each variant: share of drivers with the same class, kappa, mean |change of a|, largest change of a share.

    `others` are labellers with another scaler, by name; the corpus' own scaler is fitted here, as a variant only
    (REFERENCE section 1: a judged corpus never makes the scale). Under 30 drivers a variant is refused.
    """
    step = max(1, -(-len(corpus.info) // SCENES))
    part = corpus.with_info(corpus.info[::step])
    base = with_tdbm(_drivers(part, judge.options), judge, "track", judge.options.window_s)
    scalers = dict(others)
    refused: list[str] = []
    try:
        scalers["scaler of this corpus"] = TDBM(options=judge.options, history_s=()).fit(part)
    except InputError:
        refused.append("scaler of this corpus")
    rows = [_compared(base, with_tdbm(base.drop(*JUDGED),
                                      other, "track", judge.options.window_s)) | {"variant": variant}
            for variant, other in scalers.items()]  # fmt: skip
    for done, (variant, change) in enumerate(MEASURES.items(), start=1):
        options = change(judge.options)
        again = with_tdbm(_drivers(part, options), judge, "track", options.window_s)
        rows.append(_compared(base, again) | {"variant": variant})
        if progress is not None:
            progress(done, len(MEASURES))
    nothing = dict.fromkeys(VALUES)
    rows += [{"n_drivers": base.height, "status": "cannot be fitted", "variant": v} | nothing for v in refused]
    rows = [{"corpus": name, "scenes": len(part.info), "of_scenes": len(corpus.info)} | row for row in rows]
    return pl.DataFrame(rows, schema_overrides=dict.fromkeys(VALUES, pl.Float64), infer_schema_length=None)


def _drivers(corpus: Corpus, options: FeatureOptions) -> pl.DataFrame:
    frames = [frame_of(track_rows(scene, options), scene.unit_id, scene.start_s) for scene in corpus]
    drivers = per_driver(pl.concat(frames))
    return drivers.filter((pl.col("v_avg") > options.parked_within_m / options.window_s).fill_null(False))


def _compared(base: pl.DataFrame, again: pl.DataFrame) -> dict[str, Any]:
    keep = [*DRIVER, "tdbm", "aggressiveness"]
    both = base.select(keep).join(again.select(keep), on=list(DRIVER), suffix="_again")
    both = both.filter((pl.col("tdbm") != "undetermined") & (pl.col("tdbm_again") != "undetermined"))
    if both.height < MIN_DRIVERS:
        return {"n_drivers": both.height, "status": "too few"} | dict.fromkeys(VALUES)
    table = np.zeros((len(STYLE_CLASSES), len(STYLE_CLASSES)))
    for first, second in both.select("tdbm", "tdbm_again").iter_rows():
        table[STYLE_CLASSES.index(first), STYLE_CLASSES.index(second)] += 1
    agreement = float(kappa(table[None])[0])
    change = (both["aggressiveness"] - both["aggressiveness_again"]).abs().mean()
    return {
        "n_drivers": both.height,
        "status": "",
        "same_class": float(np.trace(table) / table.sum()),
        "kappa": agreement if np.isfinite(agreement) else None,
        "a_change": float(change) if isinstance(change, int | float) else None,
        "largest_shift": float(np.abs(table.sum(axis=0) - table.sum(axis=1)).max() / table.sum()),
    }
