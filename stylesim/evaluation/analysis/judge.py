"""Who judges the drivers of an analysis: a frozen scaler, or one of the corpus' own other half (`within`)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.evaluation.intervals import MIN_DRIVERS
from stylesim.labelers.drivers import DriverSample
from stylesim.labelers.features import FEATURES, TDBM_FEATURES
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.rows import DriverRows
from stylesim.labelers.scaler import fit_scaler
from stylesim.labelers.tdbm import TDBM
from stylesim.labels import UNDETERMINED, LabelFlag

WITHIN = "within"
DRIVER = ("unit_id", "agent_id")
FLAGS = {
    "no_leader": LabelFlag.NO_LEADER,
    "no_neighbours": LabelFlag.NO_NEIGHBOURS,
    "no_lane": LabelFlag.NO_LANE,
    "short": LabelFlag.SHORT,
    "highway": LabelFlag.HIGHWAY,
    "implausible": LabelFlag.IMPLAUSIBLE,
}
JUDGED = ("tdbm", "tdbm_transposed", "margin", "aggressiveness", "clamped")


@dataclass(frozen=True, eq=False)
class Within:
    """Two labellers of one corpus: each judges the half of the drivers that it was not fitted on.

    "Style is how one drives compared with the average driver there": the scale is the corpus' own, and nobody is on
    his own scale. Classes of two corpora that are judged so are not on one scale. `labelers` is None, and everybody
    undetermined, where a half is too small or a feature is known of nobody.
    """

    options: FeatureOptions
    labelers: tuple[TDBM, TDBM] | None


Judge = TDBM | Within


def half_of(frame: pl.DataFrame) -> pl.Series:
    """0 or 1 for each row's driver: by a hash of his name, the same in every table."""
    names = frame.select(DRIVER).iter_rows()
    found = [hashlib.sha256(f"{unit}\n{agent}".encode()).digest()[0] % 2 for unit, agent in names]
    return pl.Series("half", found, dtype=pl.Int64)


def fit_within(tables: dict[tuple[str, float], pl.DataFrame], options: FeatureOptions) -> Within:
    """Fit both halves; `tables` has one row per driver for every (span, length in s), the track's first."""
    (_, track_s), *histories = tables
    for frame in tables.values():
        usable = frame.filter(~pl.col("short") & ~pl.col("implausible"))
        half = half_of(usable.drop_nulls(TDBM_FEATURES[0]))
        sizes = [(half == number).sum() for number in (0, 1)]
        lacking = [f for f in TDBM_FEATURES if not usable[f].fill_nan(None).is_not_null().any()]
        if min(sizes) < MIN_DRIVERS or lacking:
            return Within(options, None)
    made = []
    for judged in (0, 1):
        labeler = TDBM(options=options, history_s=tuple(length for _, length in histories))
        scalers = []
        for (_, length), frame in tables.items():
            others = frame.filter(half_of(frame) != judged)
            scalers.append(fit_scaler(_sample(others), TDBM_FEATURES, length_s=length))
        labeler.track_scaler_, labeler.history_scalers_ = scalers[0], tuple(scalers[1:])
        labeler.provenance_ = {"scaler": WITHIN, "half": 1 - judged, "window_s": track_s}
        made.append(labeler)
    return Within(options, (made[0], made[1]))


def _sample(frame: pl.DataFrame) -> DriverSample:
    """As `labelers.drivers` counts: full windows, plausible motion, no gap without a leader, no v_nei when alone."""
    usable = frame.filter(~pl.col("short") & ~pl.col("implausible")).sort(DRIVER)
    value = values_of(usable)
    value[usable["no_leader"].to_numpy(), FEATURES.index("s_front")] = np.nan
    value[usable["no_neighbours"].to_numpy(), FEATURES.index("v_nei")] = np.nan
    names = tuple(usable.select(DRIVER).iter_rows())
    return DriverSample(names, value, usable["highway"].to_numpy())


def values_of(frame: pl.DataFrame) -> Float64[np.ndarray, "row feature"]:
    """The features of a frame's rows, NaN where unknown; an array of its own."""
    value = [frame[f].cast(pl.Float64).fill_null(np.nan).to_numpy() for f in FEATURES]
    return np.stack(value, axis=1).reshape(-1, len(FEATURES)).copy()


def rows_of(frame: pl.DataFrame, span: str, length_s: float) -> DriverRows:
    """The rows of a frame, for a labeller."""
    flags = np.zeros(frame.height, np.int32)
    for key, flag in FLAGS.items():
        flags |= np.where(frame[key].to_numpy(), np.int32(flag), np.int32(0))
    zero = np.zeros(frame.height, np.int32)
    scene, agent = tuple(frame["scene_id"].to_list()), tuple(frame["agent_id"].to_list())
    return DriverRows(span, length_s, scene, agent, zero, zero, values_of(frame), flags)


def with_tdbm(frame: pl.DataFrame, judge: Judge, span: str, length_s: float) -> pl.DataFrame:
    """With the classes of both orientations, the margin and the measured a (null where undetermined)."""
    if isinstance(judge, TDBM):
        return _judged(frame, judge, span, length_s)
    if judge.labelers is None:
        unknown = [pl.lit("undetermined").alias(c) for c in JUDGED[:2]]
        nothing = [pl.lit(None, pl.Float64).alias(c) for c in JUDGED[2:4]]
        return frame.with_columns(*unknown, *nothing, pl.lit(value=False).alias("clamped"))
    placed = frame.with_columns(half_of(frame), pl.int_range(frame.height, dtype=pl.Int64).alias("place"))
    parts = [_judged(placed.filter(pl.col("half") == half), labeler, span, length_s)
             for half, labeler in enumerate(judge.labelers)]  # fmt: skip
    return pl.concat(parts).sort("place").drop("half", "place")


def _judged(frame: pl.DataFrame, labeler: TDBM, span: str, length_s: float) -> pl.DataFrame:
    found = labeler.judge(rows_of(frame, span, length_s))
    names = np.array([*found.classes, "undetermined"], dtype=object)
    assert found.style_transposed is not None
    margin = np.where(found.style == UNDETERMINED, np.nan, found.margin)
    return frame.with_columns(
        pl.Series("tdbm", list(names[found.style]), dtype=pl.String),  # UNDETERMINED is -1, the last
        pl.Series("tdbm_transposed", list(names[found.style_transposed]), dtype=pl.String),
        pl.Series("margin", margin, dtype=pl.Float64).fill_nan(None),
        pl.Series("aggressiveness", found.aggressiveness, dtype=pl.Float64).fill_nan(None),
        pl.Series("clamped", (found.flags & int(LabelFlag.CLAMPED)) != 0, dtype=pl.Boolean),
    )
