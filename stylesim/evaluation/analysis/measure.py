"""What an analysis is made of: one row per driver, and one per window of a driver, with features and TDBM classes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import polars as pl

from stylesim.corpus import Corpus
from stylesim.corpus.corpus import SceneInfo
from stylesim.evaluation.analysis.judge import DRIVER, FLAGS, Judge, fit_within, with_tdbm
from stylesim.evaluation.analysis.parts import SEVERAL
from stylesim.labelers.features import FEATURES, tiled_features
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.rows import DriverRows
from stylesim.labelers.single_windows import track_and_window_rows
from stylesim.labelers.tdbm import TDBM
from stylesim.labels import LabelFlag
from stylesim.scene import Scene

# The shorter windows of split halves and stability: the history that the shipped scalers know and of which an 11 s
# track (Argoverse 2) has two. Chosen.
SHORT_WINDOW_S = 5.0


@dataclass(frozen=True, eq=False)
class Measured:
    """Drivers and windows of one corpus; `counts` says who is not among them and why.

    `drivers`: unit_id, agent_id, scene_id (first), part, the features in SI units, a column per flag, tdbm,
    tdbm_transposed, margin, aggressiveness. `windows`: the same per full window, with length_s and its number.
    """

    name: str
    drivers: pl.DataFrame
    windows: pl.DataFrame
    counts: dict[str, int]
    parts: str  # what the parts are: "official", "by unit" or "within recording"
    judge: Judge


def measured(
    corpus: Corpus,
    name: str,
    frozen: TDBM,
    *,
    within: bool = False,
    part_of: Callable[[SceneInfo], str],
    parts: str,
    progress: Callable[[int, int], None] | None = None,
) -> Measured:
    """One pass over the corpus. Parked vehicles, by the labellers' own rule, are counted and left out.

    `frozen` gives the options of the features; it judges too, unless `within`: then the corpus' other half does.
    """
    options = frozen.options
    tracks: list[pl.DataFrame] = []
    windows: list[pl.DataFrame] = []
    info = {one.scene_id: one for one in corpus.info}
    for done, scene in enumerate(corpus, start=1):
        part = part_of(info[scene.scene_id])
        for frames, found in zip((tracks, windows), _scene_frames(scene, options), strict=True):
            frames.append(found.with_columns(pl.lit(part).alias("part")))
        if progress is not None:
            progress(done, len(corpus))
    drivers = per_driver(pl.concat(tracks)) if tracks else per_driver(frame_of(_no_rows(), ""))
    every = pl.concat(windows) if windows else _windows_frame(frame_of(_no_rows(), ""), 0.0)
    parked = pl.col("v_avg") <= options.parked_within_m / options.window_s
    unknown = pl.col("v_avg").is_null() | pl.col("v_avg").is_nan()
    driving = drivers.filter(~parked & ~unknown)
    counts = {
        "motor vehicles": drivers.height,
        "parked": drivers.filter(parked & ~unknown).height,
        "seen under 1 s": drivers.filter(unknown).height,
        "drivers": driving.height,
        "without a full window of 11 s": driving["short"].sum(),
        "implausible (left out of kinematics)": driving["implausible"].sum(),
        "in more than one part": driving.filter(pl.col("part") == SEVERAL).height,
    }
    every = every.join(driving.select(*DRIVER), on=list(DRIVER), how="semi", maintain_order="left")
    judge: Judge = frozen
    if within:
        short = per_driver(every.filter(pl.col("length_s") == SHORT_WINDOW_S))
        judge = fit_within({("track", options.window_s): driving, ("history", SHORT_WINDOW_S): short}, options)
    lengths = {options.window_s: "track", SHORT_WINDOW_S: "history"}
    judged = [with_tdbm(every.filter(pl.col("length_s") == s), judge, span, s) for s, span in lengths.items()]
    driving = with_tdbm(driving, judge, "track", options.window_s)
    return Measured(name, driving, pl.concat(judged), {k: int(v) for k, v in counts.items()}, parts, judge)


def _scene_frames(scene: Scene, options: FeatureOptions) -> tuple[pl.DataFrame, pl.DataFrame]:
    agents = np.flatnonzero(scene.tracks.is_motor & scene.tracks.valid.any(axis=1))
    tracks, long, _ = track_and_window_rows(scene, options, agents)
    steps = max(1, round(SHORT_WINDOW_S / scene.tracks.dt_s))
    tiles = tiled_features(scene, steps, options)
    who, window = np.nonzero(tiles.full[agents])
    chosen = tiles.at(agents[who][:, None], window[:, None])
    flags = chosen.flags[:, 0] | np.where(chosen.highway[:, 0] >= 0.5, np.int32(LabelFlag.HIGHWAY), np.int32(0))
    short = DriverRows(
        span="history",
        length_s=SHORT_WINDOW_S,
        scene_id=(scene.scene_id,) * len(who),
        agent_id=tuple(scene.tracks.agent_id[i] for i in agents[who]),
        start_frame=np.zeros(len(who), np.int32),
        stop_frame=np.zeros(len(who), np.int32),
        value=chosen.value[:, 0],
        flags=flags.astype(np.int32),
    )
    numbered = [_windows_frame(frame_of(rows, scene.unit_id, scene.start_s), length)
                for rows, length in ((long, options.window_s), (short, SHORT_WINDOW_S))]  # fmt: skip
    return frame_of(tracks, scene.unit_id, scene.start_s), pl.concat(numbered)


def _windows_frame(frame: pl.DataFrame, length_s: float) -> pl.DataFrame:
    """With the windows' length and their number within the scene's track."""
    number = pl.int_range(pl.len()).over("agent_id").alias("window")
    return frame.with_columns(pl.lit(length_s, pl.Float64).alias("length_s"), number)


def _no_rows() -> DriverRows:
    empty = np.zeros(0, np.int32)
    return DriverRows("track", 11.0, (), (), empty, empty, np.zeros((0, len(FEATURES))), empty)


def frame_of(rows: DriverRows, unit_id: str, start_s: float = 0.0) -> pl.DataFrame:
    """One row per row of features: who, where, the features, and a column per flag."""
    n = len(rows.agent_id)
    columns = {
        "unit_id": pl.Series([unit_id] * n, dtype=pl.String),
        "agent_id": pl.Series(list(rows.agent_id), dtype=pl.String),
        "scene_id": pl.Series(list(rows.scene_id), dtype=pl.String),
        "start_s": pl.Series([start_s] * n, dtype=pl.Float64),
    }
    values = {feature: rows.value[:, i] for i, feature in enumerate(FEATURES)}
    return pl.DataFrame(columns | values | {key: rows.flagged(flag) for key, flag in FLAGS.items()})


def per_driver(tracks: pl.DataFrame) -> pl.DataFrame:
    """One row per driver: the mean of its tracks in all scenes, of those with a full window where there are any.

    As for the windows of one track: a gap without leader counts only if all are such; a flag of absence must be true
    of every track, the others of any.
    """
    if "part" not in tracks.columns:
        tracks = tracks.with_columns(pl.lit("").alias("part"))
    clean = tracks.with_columns(pl.col(list(FEATURES)).fill_nan(None))
    clean = clean.filter(~pl.col("short") | pl.col("short").all().over(list(DRIVER)))
    gap = pl.col("s_front").filter(~pl.col("no_leader")).mean().fill_null(pl.col("s_front").mean())
    return (
        clean.sort([*DRIVER, "start_s"])
        .group_by(list(DRIVER), maintain_order=True)
        .agg(
            pl.col("scene_id").first(),
            pl.len().alias("tracks"),
            pl.when(pl.col("part").n_unique() == 1).then(pl.col("part").first()).otherwise(pl.lit(SEVERAL))
            .first().alias("part"),
            *[gap.alias(f) if f == "s_front" else pl.col(f).mean() for f in FEATURES],
            *[pl.col(f).all() for f in ("no_leader", "no_neighbours", "no_lane", "short")],
            (pl.col("highway").mean() >= 0.5).alias("highway"),
            pl.col("implausible").any(),
        )
    )  # fmt: skip
