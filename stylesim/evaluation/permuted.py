"""The placebo row: a forecaster that is told somebody else's style, of the same scenario and context.

What it still gains over one that is told nothing does not come from the styles.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.asking import questions, reveal
from stylesim.evaluation.intervals import Estimate
from stylesim.evaluation.results import Evaluation
from stylesim.forecast import Conditioned, Forecast, Forecaster, ForecastTask, covered, earlier_s, horizon_s, is_told
from stylesim.randomness import stream
from stylesim.windows import WindowSpec

PERMUTED = "labels permuted"  # what is added to the name
PLACEBO_ROW = "labels_permuted"  # its place in `Evaluation.about`


class PermutedStyles:
    """`forecaster`, told what `given` holds for each (scene, t0, agent). Made by `permuted`."""

    def __init__(self, forecaster: Forecaster, given: dict[tuple[str, int, str], Any]) -> None:
        if not isinstance(forecaster, Conditioned):
            raise InputError(f"{forecaster.name} is told nothing of styles; there is nothing to permute")
        self.name = f"{forecaster.name} ({PERMUTED})"
        self._forecaster, self._conditioned, self._given = forecaster, forecaster, given

    @property
    def horizon_s(self) -> float:
        """As the forecaster's."""
        return horizon_s(self._forecaster)

    @property
    def earlier_s(self) -> float:
        """As the forecaster's."""
        return earlier_s([self._forecaster])

    def covers(self, task: ForecastTask) -> Any:
        """As the forecaster's."""
        return covered([self._forecaster], task)

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """Forecasts by the permuted styles; InputError for a driver that was not there when they were permuted."""
        return self._conditioned.predict_given(tasks, [self._rows(task) for task in tasks])

    def _rows(self, task: ForecastTask) -> Any:
        rows = []
        for agent in task.agent_index:
            key = (task.scene.scene_id, task.t0_frame, task.scene.tracks.agent_id[agent])
            if key not in self._given:
                raise InputError(f"{self.name}: {key} was not among the windows whose styles were permuted")
            rows.append(self._given[key])
        return np.stack(rows)


def permuted(
    forecaster: Forecaster,
    corpus: Corpus,
    *,
    spec: WindowSpec,
    seed: int = 0,
    beside: Sequence[Forecaster] = (),
    progress: Callable[[int, int], None] | None = None,
) -> PermutedStyles:
    """The forecaster with what it is told permuted over all windows of `corpus` within scenario and context.

    Each style is told as often as before, but to others. InputError for a forecaster that is told nothing.
    """
    if not is_told(forecaster) or not isinstance(forecaster, Conditioned):
        raise InputError(f"{forecaster.name} is told nothing of styles; there is nothing to permute")
    keys: list[tuple[str, int, str]] = []
    told, stratum = [], []
    for done, scene in enumerate(corpus, start=1):
        reveal(forecaster, scene)
        for question in questions(scene, spec, Counter(), (forecaster, *beside)):
            task = question.task
            names = task.scene.tracks.agent_id
            keys += [(scene.scene_id, task.t0_frame, names[agent]) for agent in task.agent_index]
            told += list(forecaster.style_cond(task))
            stratum += [f"{scene.scenario} {context}" for context in forecaster.contexts(task)]
        if progress is not None:
            progress(done, len(corpus))
    source = np.arange(len(keys))
    strata = np.array(stratum, dtype=str)
    for name in np.unique(strata):
        rows = np.flatnonzero(strata == name)
        source[rows] = stream(seed, 0, "", f"permuted styles {name}").permutation(rows)
    return PermutedStyles(forecaster, {key: told[i] for key, i in zip(keys, source, strict=True)})


def with_placebo_row(evaluation: Evaluation, placebo: Evaluation, *, against: Sequence[str] = ()) -> Evaluation:
    """The evaluation of a told forecaster that carries the errors of its placebo, over all moving drivers, with it.

    `against` names the forecasters beside it that are told nothing (`forecast.is_untold`).
    """
    metrics = {name: value.to_dict() for name, value in placebo.overall.metrics.items()}
    row = {"within": "scenario and context", "against": list(against), "all": metrics}
    return replace(evaluation, about={**evaluation.about, PLACEBO_ROW: row})


def placebo_row(evaluation: Evaluation) -> dict[str, Estimate]:
    """The errors with permuted styles, by metric; {} where the evaluation does not carry them."""
    row = evaluation.about.get(PLACEBO_ROW)
    return {} if row is None else {name: Estimate.from_dict(value) for name, value in row["all"].items()}
