"""Every condition: nothing but the oracle sees the future, arms have equally many parameters, checkpoints suffice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
import torch

from stylesim.cli.training import Condition as Choice
from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.evaluate import evaluate
from stylesim.forecast import ForecastTask
from stylesim.forecasting.checkpoint import load
from stylesim.forecasting.conditioner import StyleConditioner, fit_conditioner
from stylesim.forecasting.conditions import CONDITIONS, EARLIER_S, SEES_FUTURE, TABLE
from stylesim.forecasting.config import READINGS, model_config
from stylesim.forecasting.judging import LabelerJudges
from stylesim.forecasting.marginal import MARGINAL
from stylesim.forecasting.measured import Measured
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.opening import open_forecaster
from stylesim.forecasting.samples import windows
from stylesim.forecasting.style_vector import style_parameters
from stylesim.forecasting.training import train
from stylesim.scene import Scene
from stylesim.windows import earlier_scene, target_agents
from tests.conftest import make_scene

from .made import INPUTS, SMALL, SPEC, made_corpus

HONEST = [name for name, condition in TABLE.items() if not condition.sees_future]
T0 = 80
STEPS = SPEC.steps(0.1)[0]


class Once(LabelerJudges):
    """Judges that do not judge the same history twice: the tests ask about the same ones over and over."""

    seen: ClassVar[dict[tuple[object, ...], Measured]] = {}

    def measure(self, history: Scene, agent_index: np.ndarray) -> Measured:
        key = (
            self.style.method,
            history.scene_id,
            history.start_s,
            agent_index.tobytes(),
            history.tracks.position_m.tobytes(),
        )
        if key not in self.seen:
            self.seen[key] = super().measure(history, agent_index)
        return self.seen[key]


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return made_corpus(tmp_path_factory.mktemp("corpus") / "c", scenes=9, n_frames=140, n_agents=8)


@pytest.fixture(scope="module")
def judges(corpus: Corpus) -> dict[str, LabelerJudges]:
    Once.seen.clear()
    return {method: Once.fit(method, corpus.split("train"), SPEC) for method in ("tdbm", "kdsc")}


@pytest.fixture(scope="module")
def conditioners(corpus: Corpus, judges: dict[str, LabelerJudges]) -> dict[str, StyleConditioner]:
    return {
        name: fit_conditioner(name, judges[condition.method], windows(corpus, SPEC), seed=0)[0]
        for name, condition in TABLE.items()
    }


@pytest.fixture(scope="module")
def models(corpus: Corpus, judges: dict[str, LabelerJudges], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("models")
    for name in CONDITIONS:
        told = None if name == "none" else judges[TABLE[name].method]
        train(
            corpus, condition=name, judges=told, spec=SPEC, max_steps=2, epochs=1, batch_size=64, seed=1,
            out=folder / name, cache=folder / "cache", accelerator="cpu",
        )  # fmt: skip
    return folder


def cond(conditioner: StyleConditioner, scene: Scene) -> np.ndarray:
    agents = target_agents(scene, T0, SPEC, need_future=False)
    earlier = earlier_scene(scene, T0, STEPS, conditioner.earlier_s)
    return conditioner.style_cond(scene.history(T0, STEPS), agents, earlier=earlier)


def without_future(scene: Scene) -> Scene:
    tracks = scene.tracks
    arrays = {name: np.array(getattr(tracks, name)) for name in ("position_m", "velocity_mps", "heading_rad", "valid")}
    for name, array in arrays.items():
        array[:, T0 + 1 :] = False if name == "valid" else np.nan
    return replace(scene, tracks=replace(tracks, driver=(None,) * tracks.n_agents, **arrays))


@pytest.mark.parametrize("name", HONEST)
def test_with_the_future_set_to_nan_not_a_bit_changes(name: str, conditioners: dict[str, StyleConditioner]) -> None:
    scene = make_scene(seed=50, n_agents=8, n_frames=140)
    whole, cut = (cond(conditioners[name], one) for one in (scene, without_future(scene)))
    assert whole.dtype == cut.dtype
    assert whole.tobytes() == cut.tobytes()
    known = whole[:, 0] >= 0 if whole.dtype == np.int64 else np.isfinite(whole).all(axis=1)
    assert known.any()


def test_the_test_above_would_notice_a_label_that_sees_the_future(conditioners: dict[str, StyleConditioner]) -> None:
    judges = conditioners["oracle"].judges
    assert isinstance(judges, LabelerJudges)
    scenes = [make_scene(seed=seed, n_agents=8, n_frames=140) for seed in range(50, 60)]
    agents = np.arange(8, dtype=np.int32)
    found = [[judges.whole_track(s, agents) for s in (scene, without_future(scene))] for scene in scenes]
    assert any((whole != cut).any() for whole, cut in found)


def test_the_command_line_offers_what_there_is() -> None:
    assert tuple(Choice) == CONDITIONS


def test_every_arm_has_as_many_parameters(models: Path) -> None:
    networks = {name: load(models / name).network for name in CONDITIONS}
    counts = {name: sum(p.numel() for p in network.parameters()) for name, network in networks.items()}
    assert len(set(counts.values())) == 1, counts
    working = {name: sum(p.numel() for p in n.parameters() if p.requires_grad) for name, n in networks.items()}
    assert working["tdbm"] == counts["tdbm"]
    assert working["features"] > 0.99 * counts["features"]
    assert working["none"] < working["kdsc"] < working["tdbm"]


@pytest.mark.parametrize("reading", READINGS)
def test_whatever_the_style_everything_else_starts_alike(reading: str) -> None:
    states, counts = [], set()
    for style in ({}, {"styles": 6}, {"styles": 2}, {"style_features": 8}):
        config = model_config("tiny", INPUTS, **SMALL, **style, reading=reading)
        torch.manual_seed(0)
        network = ForecastNetwork(replace(config, style_parameters=style_parameters(config)))
        counts.add(sum(p.numel() for p in network.parameters()))
        states.append({k: v for k, v in network.state_dict().items() if not k.startswith(("style.", "idle"))})
    assert len(counts) == 1
    for state in states[1:]:
        assert state.keys() == states[0].keys()
        assert all(torch.equal(value, states[0][key]) for key, value in state.items())


@pytest.mark.parametrize("name", HONEST)
def test_a_checkpoint_predicts_what_was_trained(name: str, models: Path, corpus: Corpus) -> None:
    model = load(models / name)
    assert not model.sees_future
    assert model.name == f"tiny-{name}-early"
    assert model.earlier_s == (EARLIER_S if "earlier" in name else 0.0)
    scene = make_scene(seed=51, n_agents=8, n_frames=140)
    agents = target_agents(scene, T0, SPEC)
    earlier = earlier_scene(scene, T0, STEPS, model.earlier_s)
    task = ForecastTask(scene.history(T0, STEPS), agents, 30, T0, earlier)
    own, ignorant, if_timid = (model.predict([task], style)[0] for style in (None, "none", model.styles[-1]))
    assert not np.array_equal(own.mode_m, ignorant.mode_m)
    assert not np.array_equal(if_timid.mode_m, ignorant.mode_m)
    given = model.predict_given([task], [model.style_cond(task)])[0]
    assert given.mode_m.tobytes() == own.mode_m.tobytes()
    with pytest.raises(InputError, match="no oracle"):
        model.reveal(corpus)


def test_earlier_windows_are_looked_at_where_there_are_some(conditioners: dict[str, StyleConditioner]) -> None:
    scenes = [make_scene(seed=seed, n_agents=8, n_frames=140) for seed in range(60, 70)]
    for name, like in (("earlier", "tdbm"), ("earlier_features", "features")):
        history_only, with_earlier = [], []
        for scene in scenes:
            agents = target_agents(scene, T0, SPEC)
            history = scene.history(T0, STEPS)
            earlier = earlier_scene(scene, T0, STEPS, EARLIER_S)
            assert earlier is not None
            assert earlier.tracks.n_frames == T0 - STEPS + 1
            history_only.append(conditioners[name].style_cond(history, agents))
            with_earlier.append(conditioners[name].style_cond(history, agents, earlier=earlier))
            if name == "earlier":
                seen = conditioners[like].judges.measure(history, agents)
                np.testing.assert_array_equal(history_only[-1], conditioners[name].cells.assign(seen))  # type: ignore[union-attr]
        assert not np.array_equal(np.concatenate(history_only), np.concatenate(with_earlier))
    assert earlier_scene(scenes[0], STEPS - 1, STEPS, EARLIER_S) is None


def test_random_labels_have_the_marginals_and_stay_with_their_driver(
    corpus: Corpus, judges: dict[str, LabelerJudges], conditioners: dict[str, StyleConditioner]
) -> None:
    random = conditioners["random"]
    real = fit_conditioner("tdbm", judges["tdbm"], windows(corpus, SPEC), seed=0)[1]
    from stylesim.forecasting.random_cells import RandomCells

    lots = random.cells
    assert isinstance(lots, RandomCells)
    drawn = lots.draw([f"driver {i}" for i in range(4000)])
    train_rows = np.concatenate([np.full(len(w.targets), w.split == "train") for w in windows(corpus, SPEC)])
    share = [(real[train_rows][:, 0] == z).mean() for z in range(-1, 6)]
    np.testing.assert_allclose([(drawn[:, 0] == z).mean() for z in range(-1, 6)], share, atol=0.03)
    scene = make_scene(seed=52, n_agents=8, n_frames=140)
    agents = np.arange(8, dtype=np.int32)
    one, later = (random.style_cond(scene.history(t0, STEPS), agents) for t0 in (40, 100))
    np.testing.assert_array_equal(one, later)
    assert len(np.unique(one, axis=0)) > 1


def test_an_oracle_says_so_and_must_be_told(models: Path, corpus: Corpus) -> None:
    oracle = load(models / "oracle")
    assert oracle.sees_future
    assert SEES_FUTURE in oracle.name
    scene = next(iter(corpus.split("val")))
    task = ForecastTask(scene.history(T0, STEPS), target_agents(scene, T0, SPEC), 30, T0)
    with pytest.raises(InputError, match=SEES_FUTURE):
        oracle.predict([task])
    assert oracle.predict([task], "timid")[0].mode_m.shape[0] == len(task.agent_index)
    oracle.reveal(corpus)
    names = [scene.tracks.driver[i] for i in task.agent_index]
    told = oracle.style_cond(task)[:, 0]
    for driver, z in zip(names, told, strict=True):
        if driver is not None and z >= 0:
            assert oracle.styles[z] == driver.name
    judged = evaluate(load(models / "oracle"), corpus.split("val"), by=("scenario",), spec=SPEC)
    assert SEES_FUTURE in judged.forecaster


@pytest.mark.parametrize("name", TABLE)
def test_every_model_can_average_over_styles_and_the_oracle_is_honest_then(name: str, models: Path) -> None:
    model = open_forecaster(f"{models / name}@{MARGINAL}")
    assert model.name == f"tiny-{name}-early@{MARGINAL}"  # without the oracle's mark
    scene = make_scene(seed=53, n_agents=8, n_frames=140)
    answers = []
    for one in (scene, without_future(scene)):
        agents = target_agents(one, T0, SPEC, need_future=False)
        task = ForecastTask(one.history(T0, STEPS), agents, 30, T0, earlier_scene(one, T0, STEPS, EARLIER_S))
        answers.append(model.predict([task])[0])
    assert answers[0].mode_m.tobytes() == answers[1].mode_m.tobytes()
    assert answers[0].probability.tobytes() == answers[1].probability.tobytes()
    np.testing.assert_allclose(answers[0].probability.sum(axis=1), 1.0, atol=1e-5)


def test_condition_names_are_checked_before_any_work(corpus: Corpus, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="tdbm_scores"):
        train(corpus, condition="tdbm_score", spec=SPEC, out=tmp_path / "m")
