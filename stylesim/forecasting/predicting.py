"""`predict`: forecasts for a corpus in files, also as if everyone were of another style."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.corpus import Corpus
from stylesim.corpus.files import new_folder, write_whole
from stylesim.errors import InputError
from stylesim.forecast import Forecast, Forecaster, ForecastTask, Oracle, covered, earlier_s
from stylesim.forecasting.conditions import SEES_FUTURE
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.marginal import MARGINAL, NO_STYLE, AsStyle
from stylesim.forecasting.samples import Progress
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, earlier_scene, target_agents

OWN, EVERY = "history", "all"  # as styles: what each driver's history shows; all there are
BATCH = 16  # tasks per call; chosen as in `evaluate`
SCHEMA: dict[str, Any] = {
    "scenario_id": pl.String, "track_id": pl.String, "t0_frame": pl.Int32, "probability": pl.Float32,
    "predicted_trajectory_x": pl.List(pl.Float64), "predicted_trajectory_y": pl.List(pl.Float64),
}  # fmt: skip


def styles_of(forecaster: Forecaster) -> tuple[str, ...]:
    """What can be asked of a forecaster: "history", and of a conditioned model "none", its classes, "marginal"."""
    if not isinstance(forecaster, TrainedForecaster) or forecaster.conditioner is None:
        return (OWN,)
    learned = () if forecaster.conditioner.posterior is None else (MARGINAL,)
    own = () if forecaster.sees_future else (OWN,)
    return (*own, NO_STYLE, *forecaster.styles, *learned)


def predict(
    forecaster: Forecaster,
    corpus: Corpus,
    *,
    out: str | Path,
    styles: Sequence[str] = (OWN,),
    spec: WindowSpec = WindowSpec(),
    progress: Progress | None = None,
) -> dict[str, Path]:
    """Forecasts of every motor vehicle at every t0 of a corpus; one Parquet file per style in the folder `out`.

    `styles` are of `styles_of`: "history" takes what each driver's history shows, a class asks what everyone would do
    if he were of that class, "none" asks without style, "marginal" averages over the classes, "all" is all of these.
    A t0 is the one that the scene's source fixes, else every stride from the first whole history to the scene's last
    frame: no future is needed. The files have the columns of an Argoverse 2 submission and `t0_frame`, one row per
    mode, most probable first, in the scene's own coordinates; `evaluate` and `stress` read them. A file is held in
    memory until it is written. InputError for a style that the forecaster does not know, an `out` that exists, an
    oracle asked for "history", or a corpus without anyone to forecast.
    """
    known = styles_of(forecaster)
    wanted = known if EVERY in styles else tuple(dict.fromkeys(styles))
    if not wanted:
        raise InputError("name at least one style to predict with")
    for style in wanted:
        if style not in known:
            oracle = isinstance(forecaster, Oracle) and forecaster.sees_future
            why = f": an oracle ({SEES_FUTURE}) knows no truth here" if oracle and style == OWN else ""
            raise InputError(
                f"{forecaster.name} cannot be asked with style {style!r}{why}; it knows {', '.join(known)}"
            )
    asked = {style: _asked(forecaster, style) for style in wanted}
    final, partial = new_folder(out)
    if any((partial / name).exists() for name in ("request.json", "training.json")):
        raise InputError(f"{partial} is left from an unfinished run of another verb; finish it, or remove it")
    shutil.rmtree(partial, ignore_errors=True)  # of a run that was killed
    frames: dict[str, list[pl.DataFrame]] = {style: [] for style in wanted}
    stream = _tasks(corpus, spec, forecaster, progress)
    while group := list(islice(stream, BATCH)):
        for style, one in asked.items():
            rows = [row for task, answer in zip(group, one.predict(group), strict=True) for row in _rows(task, answer)]
            frames[style].append(pl.DataFrame(rows, schema=SCHEMA))
    if not any(frames.values()):
        raise InputError(f"{corpus.path} has nobody to forecast: no motor vehicle with {spec.history_s:g} s before it")
    partial.mkdir(parents=True)
    for style, parts in frames.items():
        buffer = io.BytesIO()
        pl.concat(parts).write_parquet(buffer, compression="zstd", row_group_size=65536)
        write_whole(partial / f"{style}.parquet", buffer.getvalue())
    partial.rename(final)
    return {style: final / f"{style}.parquet" for style in wanted}


def _asked(forecaster: Forecaster, style: str) -> Forecaster:
    if style == OWN:
        return forecaster
    assert isinstance(forecaster, TrainedForecaster)  # others know no style
    return AsStyle(forecaster, style)


def _tasks(
    corpus: Corpus, spec: WindowSpec, forecaster: Forecaster, progress: Progress | None
) -> Iterator[ForecastTask]:
    for done, scene in enumerate(corpus, start=1):
        history, future, stride = spec.steps(scene.tracks.dt_s)
        for t0 in _anchors(scene, history, stride):
            agents = target_agents(scene, t0, spec, need_future=False)
            earlier = earlier_scene(scene, t0, history, earlier_s([forecaster]))
            task = ForecastTask(scene.history(t0, history), agents, future, t0, earlier)
            able = covered([forecaster], task)
            if able.any():
                yield ForecastTask(task.scene, agents[able], future, t0, earlier)
        if progress is not None:
            progress(done, len(corpus))


def _anchors(scene: Scene, history: int, stride: int) -> Sequence[int]:
    return range(history - 1, scene.tracks.n_frames, stride) if scene.t0_frame is None else [scene.t0_frame]


def _rows(task: ForecastTask, answer: Forecast) -> Iterator[dict[str, Any]]:
    tracks = task.scene.tracks
    for driver, agent in enumerate(task.agent_index):
        for mode in (-answer.probability[driver]).argsort(kind="stable"):
            path = answer.mode_m[driver, mode] + tracks.origin_m
            yield {
                "scenario_id": task.scene.scene_id,
                "track_id": tracks.agent_id[agent],
                "t0_frame": task.t0_frame,
                "probability": float(answer.probability[driver, mode]),
                "predicted_trajectory_x": path[:, 0].tolist(),
                "predicted_trajectory_y": path[:, 1].tolist(),
            }
