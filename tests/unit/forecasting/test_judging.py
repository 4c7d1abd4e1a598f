"""The real labellers behind `style_cond`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.forecasting.checkpoint import load
from stylesim.forecasting.conditioner import fit_conditioner
from stylesim.forecasting.judging import LabelerJudges
from stylesim.forecasting.samples import windows
from stylesim.forecasting.training import train
from tests.conftest import make_scene

from .made import SPEC, made_corpus, task_of


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return made_corpus(tmp_path_factory.mktemp("corpus") / "c", scenes=12, n_frames=140, n_agents=8)


@pytest.mark.parametrize("condition", ["tdbm", "kdsc"])
def test_fitted_on_train_it_judges_histories_and_survives_json(corpus: Corpus, condition: str) -> None:
    judges = LabelerJudges.fit(condition, corpus.split("train"), SPEC)
    conditioner, style = fit_conditioner(condition, judges, windows(corpus, SPEC), seed=0)
    known = style[:, 0] >= 0
    assert known.mean() > 0.3
    assert (style[known] < conditioner.cells.filled.shape).all()
    back = LabelerJudges.from_dict(json.loads(json.dumps(judges.to_dict())))
    assert back.classes == judges.classes
    task = task_of(make_scene(seed=77, n_agents=8), 40)
    a, b = (j.measure(task.scene, task.agent_index) for j in (judges, back))
    np.testing.assert_array_equal(a.style, b.style)
    np.testing.assert_array_equal(a.feature, b.feature)
    np.testing.assert_array_equal(a.highway, b.highway)


def test_another_method_is_refused(corpus: Corpus) -> None:
    with pytest.raises(InputError, match="tdbm"):
        LabelerJudges.fit("tdmb", corpus.split("train"), SPEC)


@pytest.mark.parametrize(("condition", "fusion"), [("tdbm", "late"), ("kdsc", "early")])
def test_a_conditioned_model_needs_nothing_but_its_checkpoint(
    corpus: Corpus, tmp_path: Path, condition: str, fusion: str
) -> None:
    out = tmp_path / "model"
    model = train(
        corpus,
        condition=condition,
        fusion=fusion,
        spec=SPEC,
        epochs=1,
        batch_size=64,
        out=out,
        cache=tmp_path / "cache",
    )
    again = load(out)
    assert again.name == f"tiny-{condition}-{fusion}"
    task = task_of(make_scene(seed=77, n_agents=8), 40)
    assert again.predict([task])[0].mode_m.tobytes() == model.predict([task])[0].mode_m.tobytes()
    assert again.styles == model.styles
    assert len(again.styles) == (6 if condition == "tdbm" else 2)
    assert "style_effect_m" in json.loads((out / "training.json").read_text())["curve"][0]
