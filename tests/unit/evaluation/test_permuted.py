from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.asking import questions
from stylesim.evaluation.permuted import PERMUTED, permuted, placebo_row
from stylesim.evaluation.results import load_evaluation
from stylesim.forecast import Forecast, ForecastTask, is_untold
from stylesim.forecasting.baselines import ConstantVelocity
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.marginal import AsStyle
from stylesim.report.evaluate import evaluate
from stylesim.report.sections import placebo_warnings
from tests.unit.forecasting.made import SPEC, made_corpus, untrained


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return made_corpus(tmp_path_factory.mktemp("p") / "c", scenes=12, n_agents=5)


@pytest.fixture(scope="module")
def model() -> TrainedForecaster:
    return untrained(styled=True)


def told(model: TrainedForecaster, corpus: Corpus) -> dict[tuple[str, int, str], tuple[str, int, bytes]]:
    """(scenario, context, what is told) of every window."""
    found = {}
    for scene in corpus:
        for question in questions(scene, SPEC, Counter(), (model,)):
            task = question.task
            rows = zip(task.agent_index, model.style_cond(task), model.contexts(task), strict=True)
            for agent, row, context in rows:
                key = (scene.scene_id, task.t0_frame, scene.tracks.agent_id[agent])
                found[key] = scene.scenario, int(context), row.tobytes()
    return found


def test_each_style_is_told_as_often_as_before_within_scenario_and_context(
    model: TrainedForecaster, corpus: Corpus
) -> None:
    before = told(model, corpus)
    placebo = permuted(model, corpus, spec=SPEC, seed=3)
    after = {key: (*before[key][:2], row.tobytes()) for key, row in placebo._given.items()}
    assert after.keys() == before.keys()
    assert Counter(after.values()) == Counter(before.values())
    moved = [key for key in before if after[key] != before[key]]
    assert len(moved) > len(before) / 4
    again = permuted(model, corpus, spec=SPEC, seed=3)
    assert all(np.array_equal(again._given[key], row) for key, row in placebo._given.items())
    other = permuted(model, corpus, spec=SPEC, seed=4)
    assert any(not np.array_equal(other._given[key], row) for key, row in placebo._given.items())


def test_the_report_of_a_told_forecaster_beside_another_has_its_placebo(
    model: TrainedForecaster, corpus: Corpus, tmp_path: Path
) -> None:
    report = evaluate([ConstantVelocity(), model], corpus, by=("scenario",), spec=SPEC)
    names = [one.forecaster for one in report.evaluations]
    assert names == ["constant_velocity", "untrained", f"untrained ({PERMUTED})"]
    plain, own, placebo = report.evaluations
    assert own.overall.metrics["min_fde_m"].value != placebo.overall.metrics["min_fde_m"].value
    assert placebo_row(own)["min_fde_m"].value == placebo.overall.metrics["min_fde_m"].value
    assert placebo_row(plain) == {} == placebo_row(placebo)
    page = report.save(tmp_path / "report.html").read_text()
    assert PERMUTED in page
    saved = load_evaluation(tmp_path / "untrained.json")
    assert placebo_row(saved)["min_fde_m"].value == pytest.approx(placebo_row(own)["min_fde_m"].value)


def test_alone_or_asked_to_it_has_none(model: TrainedForecaster, corpus: Corpus) -> None:
    alone = evaluate(model, corpus, by=("scenario",), spec=SPEC)
    assert [one.forecaster for one in alone.evaluations] == ["untrained"]
    without = evaluate([ConstantVelocity(), model], corpus, by=("scenario",), spec=SPEC, placebo=False)
    assert len(without.evaluations) == 2


class Lost:
    """A kilometre off: whoever is told anything, right or wrong, is better."""

    name = "lost"

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        return [Forecast(one.mode_m + 1000.0, one.probability) for one in ConstantVelocity().predict(tasks)]


class LostAndUntold(Lost):
    """The same, as a model that could be told of styles."""

    name = "lost model"
    styles: tuple[str, ...] = ()


def test_a_gain_that_is_not_from_the_styles_is_warned_of(model: TrainedForecaster, corpus: Corpus) -> None:
    beside = [Lost(), LostAndUntold(), model]
    found = placebo_warnings(evaluate(beside, corpus, by=("scenario",), spec=SPEC).evaluations)
    # only beside the model that is told nothing: any network beats a baseline, whatever it is told
    assert len(found) == 1
    assert "labels permuted) is better than lost model by" in found[0]


def test_untold_are_networks_without_style_and_those_that_are_asked_without(model: TrainedForecaster) -> None:
    assert is_untold(untrained())
    assert is_untold(AsStyle(model, "none"))
    for other in (model, AsStyle(model, model.styles[0]), ConstantVelocity()):
        assert not is_untold(other)


def test_who_is_told_nothing_has_nothing_to_permute(corpus: Corpus) -> None:
    for one in (ConstantVelocity(), untrained()):
        with pytest.raises(InputError, match="nothing to permute"):
            permuted(one, corpus, spec=SPEC)
