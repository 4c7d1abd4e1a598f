"""`style_table`: `style_cond` of every sample of a corpus as a table, for a forecaster of one's own. No torch."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import polars as pl

from stylesim.corpus import Corpus
from stylesim.forecasting.conditioner import Judges, StyleConditioner, fit_conditioner
from stylesim.forecasting.conditions import condition_of
from stylesim.forecasting.samples import Progress, Window, windows
from stylesim.windows import WindowSpec

CELL_COLUMNS = ("z", "k", "c")


def style_table(
    corpus: Corpus,
    condition: str = "tdbm",
    *,
    spec: WindowSpec = WindowSpec(),
    judges: Judges | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[StyleConditioner, pl.DataFrame]:
    """The fitted conditioner, and one row per (scene, t0, agent) of the train and val scenes.

    Columns: scene_id, agent_id, t0_frame, split, and z, k, c (-1 for the null token), or v0, v1, ... (NaN for it) where
    the condition is a vector. Everything is fitted on the training split; labellers too, unless `judges` are given.
    At prediction time `conditioner.style_cond(scene.history(t0, steps), agents)` gives the same for a new scene.
    InputError for an unknown condition, or a corpus without those splits.
    """
    method = condition_of(condition).method
    if judges is None:
        from stylesim.forecasting.judging import LabelerJudges

        judges = LabelerJudges.fit(method, corpus.split("train"), spec, progress=progress)
    rows: list[tuple[str, str, int, str]] = []

    def noted() -> Iterator[Window]:
        for window in windows(corpus, spec, progress=progress):
            names = (window.history.tracks.agent_id[i] for i in window.targets)
            rows.extend((window.scene.scene_id, name, window.t0, window.split) for name in names)
            yield window

    conditioner, cond = fit_conditioner(condition, judges, noted(), seed=seed)
    is_cell = cond.dtype == np.int64
    columns = CELL_COLUMNS if is_cell else tuple(f"v{i}" for i in range(cond.shape[1]))
    who = pl.DataFrame(rows, schema=["scene_id", "agent_id", "t0_frame", "split"], orient="row")
    return conditioner, who.hstack([pl.Series(name, cond[:, i]) for i, name in enumerate(columns)])
