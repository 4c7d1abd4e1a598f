"""KDSC fitted on a corpus' training part: clusters, mean speeds in them, training against held out, and TDBM's view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Bool, Float64

from stylesim.evaluation.analysis.judge import DRIVER, values_of
from stylesim.evaluation.analysis.measure import Measured
from stylesim.evaluation.analysis.parts import TRAIN, held_out_of
from stylesim.evaluation.analysis.shares import NAMES
from stylesim.evaluation.analysis.statistics import cliffs_delta, resampled
from stylesim.evaluation.intervals import MIN_DRIVERS, estimate
from stylesim.labelers.drivers import DriverSample
from stylesim.labelers.features import FEATURES
from stylesim.labelers.kdsc_model import CLUSTERED_FROM, SpanModel, cluster_tracks, clustered
from stylesim.randomness import stream

CLUSTERS = ("aggressive", "normal")
MOST = 10_000  # as KDSC's own max_tracks: Ward holds their pairwise distances
ENDS = ("p", "delta", "delta_low", "delta_high")


@dataclass(frozen=True, eq=False)
class Clustered:
    """Drivers with their cluster (`kdsc`), the standardised `level` and the distance to their `centre`."""

    drivers: pl.DataFrame
    model: SpanModel | None  # None where the training part is too small
    fitted_on: int


def clusters_of(one: Measured, *, seed: int) -> Clustered:
    """Ward's two clusters of the training part's drivers; everybody gets the nearest centroid's name.

    Only drivers with a full window and plausible motion are clustered and named. Refused (no cluster for anyone)
    where the training part has fewer than 30 of them.
    """
    from sklearn.cluster import AgglomerativeClustering

    known = pl.all_horizontal(pl.col(list(CLUSTERED_FROM)).is_not_null())
    usable = one.drivers.filter(~pl.col("short") & ~pl.col("implausible") & known)
    train = usable.filter(pl.col("part") == TRAIN).sort(list(DRIVER))
    if train.height < MIN_DRIVERS:
        named = usable.with_columns(
            pl.lit(None, pl.String).alias("kdsc"), *[pl.lit(None, pl.Float64).alias(c) for c in ("level", "centre")]
        )
        return Clustered(named, None, train.height)
    if train.height > MOST:
        chosen = stream(seed, 0, "", f"kdsc {one.name}").choice(train.height, MOST, replace=False)
        train = train[np.sort(chosen)]
    ward = AgglomerativeClustering(n_clusters=len(CLUSTERS), linkage="ward")
    model, _ = cluster_tracks(_sample(train), ward, len(CLUSTERS), length_s=11.0)
    sample = _sample(usable)
    raw = sample.value[:, [FEATURES.index(name) for name in CLUSTERED_FROM]]
    standard = model.standardised(clustered(raw, sample.highway, model.jerk_scale_mps3))
    distance = model.distances(standard)
    nearest = distance.argmin(axis=1)
    return Clustered(
        usable.with_columns(
            pl.Series("kdsc", [CLUSTERS[i] for i in nearest], dtype=pl.String),
            pl.Series("level", standard.mean(axis=1)),
            pl.Series("centre", distance.min(axis=1)),
        ),
        model,
        train.height,
    )


def _sample(frame: pl.DataFrame) -> DriverSample:
    return DriverSample(tuple(frame.select(DRIVER).iter_rows()), values_of(frame), frame["highway"].to_numpy())


def speed_tests(one: Measured, found: Clustered, *, seed: int) -> pl.DataFrame:
    """Mean speed, which is not clustered by: aggressive against normal in each part, and training against held out.

    Mann-Whitney p and Cliff's delta (aggressive minus normal; held out minus training). var_speed is clustered by and
    goes with speed, so that the first test is partly circular.
    """
    parts = [TRAIN, *held_out_of(set(one.drivers["part"].to_list()))]
    rows: list[dict[str, Any]] = []
    for part in parts:
        both = found.drivers.filter((pl.col("part") == part) & pl.col("kdsc").is_not_null())
        mine = (both["kdsc"] == CLUSTERS[0]).to_numpy()
        what: dict[str, Any] = {"corpus": one.name, "comparison": "aggressive against normal", "of": part}
        rows.append(what | _difference(both, mine, seed=seed, purpose=f"{one.name} speed {part}"))
    for other in parts[1:]:
        for cluster in CLUSTERS:
            both = found.drivers.filter(pl.col("part").is_in([TRAIN, other]) & (pl.col("kdsc") == cluster))
            mine = (both["part"] == other).to_numpy()
            what = {"corpus": one.name, "comparison": f"{other} against {TRAIN}", "of": cluster}
            rows.append(what | _difference(both, mine, seed=seed, purpose=f"{one.name} speed {other} {cluster}"))
    return pl.DataFrame(rows, schema_overrides=dict.fromkeys(ENDS, pl.Float64), infer_schema_length=None)


def _difference(both: pl.DataFrame, mine: Bool[np.ndarray, " driver"], *, seed: int, purpose: str) -> dict[str, Any]:
    from scipy.stats import mannwhitneyu

    sizes = {"n_first": int(mine.sum()), "n_second": int((~mine).sum())}
    if min(sizes.values()) < MIN_DRIVERS:
        return sizes | dict.fromkeys(ENDS) | {"status": "too few"}
    value = both["mean_speed"].to_numpy()

    def delta(weight: Float64[np.ndarray, "draw driver"]) -> Float64[np.ndarray, " draw"]:
        return cliffs_delta(weight * mine, weight * ~mine, value)

    found = resampled(delta, both["unit_id"].to_list(), seed=seed, purpose=purpose)
    p = float(mannwhitneyu(value[mine], value[~mine]).pvalue)
    return sizes | {
        "p": p, "delta": found.value, "delta_low": found.low, "delta_high": found.high, "status": found.status
    }  # fmt: skip


def with_tdbm_classes(one: Measured, found: Clustered, *, seed: int) -> pl.DataFrame:
    """Share of KDSC's aggressive drivers in each TDBM class (printed), and Cramér's V of the two over all of them."""
    from scipy.stats.contingency import association

    drivers = found.drivers.filter(pl.col("kdsc").is_not_null())
    rows = []
    for style in NAMES:
        own = drivers.filter(pl.col("tdbm") == style)
        share = estimate(
            (own["kdsc"] == CLUSTERS[0]).to_numpy().astype(np.float64),
            own["unit_id"].to_list(), seed=seed, purpose=f"{one.name} kdsc {style}", rate=True,
        )  # fmt: skip
        rows.append({"corpus": one.name, "class": style, **share.to_dict()})
    judged = drivers.filter(pl.col("tdbm") != "undetermined")
    classes, cluster = (judged[c].to_numpy().astype(str) for c in ("tdbm", "kdsc"))
    names = [np.unique(classes, return_inverse=True), np.unique(cluster, return_inverse=True)]
    shape = tuple(len(n[0]) for n in names)
    table = np.zeros(shape, np.int64)
    np.add.at(table, (names[0][1], names[1][1]), 1)
    known = judged.height >= MIN_DRIVERS and min(shape) >= 2
    value = float(association(table, method="cramer", correction=False)) if known else None
    rows.append({
        "corpus": one.name, "class": "Cramér's V", "value": value, "low": None, "high": None,
        "n_drivers": judged.height, "n_units": judged["unit_id"].n_unique(), "status": "" if known else "too few",
    })  # fmt: skip
    kinds = dict.fromkeys(("value", "low", "high"), pl.Float64)
    return pl.DataFrame(rows, schema_overrides=kinds, infer_schema_length=None)
