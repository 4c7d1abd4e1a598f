"""Dense prediction: whose future is known, what is learned of it, and that it may be left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from stylesim.corpus import Corpus
from stylesim.forecasting.batching import gather, to_scene
from stylesim.forecasting.checkpoint import load
from stylesim.forecasting.config import ModelConfig, model_config
from stylesim.forecasting.data import TrainingData
from stylesim.forecasting.mixing import MixedData
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.neighbours import LOSS_SCALE_M, neighbour_futures, neighbour_loss, sample_of_agent
from stylesim.forecasting.samples import compiled
from stylesim.forecasting.training import train
from tests.conftest import make_scene

from .made import INPUTS, SMALL, SPEC, made_corpus, task_of

CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return made_corpus(tmp_path_factory.mktemp("corpus") / "c")


@pytest.fixture(scope="module")
def data(corpus: Corpus, tmp_path_factory: pytest.TempPathFactory) -> TrainingData:
    store = compiled(corpus, SPEC, INPUTS, tmp_path_factory.mktemp("cache"))
    return TrainingData(store, np.full((len(store), 3), -1, np.int64), INPUTS, dense=True)


def test_futures_around_are_where_those_agents_went(data: TrainingData, corpus: Corpus) -> None:
    index = data.split(0)[:20]
    batch = gather(data.store, index, INPUTS)
    found = neighbour_futures(data.store, batch, sample_of_agent(data.store))
    assert np.isnan(found[:, 0]).all()  # the target itself
    known = np.isfinite(found).all(axis=(2, 3))
    assert known.any(axis=1).all()
    assert not known[~batch.agent_valid].any()
    scenes = list(corpus.with_info(info for info in corpus.info if info.split in ("train", "val")))
    for i, (scene_number, t0, _, _) in enumerate(data.store.origin[index].tolist()):
        truth = scenes[scene_number].tracks.position_m[:, t0 + 1 : t0 + 1 + INPUTS.future_steps]
        for path in to_scene(found[i : i + 1, known[i]], batch.pose[i : i + 1])[0]:
            assert np.nanmin(np.abs(truth - path).max(axis=(1, 2))) < 1e-3


def test_the_loss_is_the_mean_over_what_is_known() -> None:
    truth = torch.full((2, 3, 4, 2), torch.nan)
    truth[0, 1] = 0.0
    path = torch.full((2, 3, 4, 2), 5.0, requires_grad=True)
    loss = neighbour_loss(path, truth)
    torch.testing.assert_close(loss, torch.tensor([4.5 / LOSS_SCALE_M, 0.0]))
    loss.sum().backward()  # type: ignore[no-untyped-call]
    assert path.grad is not None
    assert (path.grad[0, 1] > 0).all()
    assert path.grad.isfinite().all()
    assert (path.grad[1] == 0).all()


def test_it_learns_where_the_others_go(data: TrainingData) -> None:
    torch.manual_seed(0)
    network = ForecastNetwork(model_config("tiny", INPUTS, **SMALL, dense=True))
    example = data.example(data.split(0)[:48], CPU)
    assert example.neighbour_m is not None
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-2)
    losses = []
    for _ in range(150):
        path = network(example.inputs)[-1].neighbour_m
        assert path is not None
        loss = neighbour_loss(path, example.neighbour_m).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    now = example.inputs.agent[:, :, -1]
    straight = now[:, :, None, 0:2] + now[:, :, None, 2:4] * network.time_s
    assert losses[-1] < 0.8 * float(neighbour_loss(straight, example.neighbour_m).mean())


def test_the_decoder_looks_at_it_and_without_it_nothing_changes(data: TrainingData) -> None:
    example = data.example(data.split(0)[:8], CPU)
    with torch.no_grad():
        torch.manual_seed(0)
        plain = ForecastNetwork(model_config("tiny", INPUTS, **SMALL)).eval()
        torch.manual_seed(0)
        dense = ForecastNetwork(model_config("tiny", INPUTS, **SMALL, dense=True)).eval()
        without, before = plain(example.inputs)[-1], dense(example.inputs)[-1]
        assert without.neighbour_m is None
        assert not torch.equal(without.mean_m, before.mean_m)
        assert dense.neighbours is not None
        dense.neighbours.path[2].bias += 1.0  # type: ignore[operator]
        assert not torch.equal(before.mean_m, dense(example.inputs)[-1].mean_m)
        dense.neighbours.back[2].weight.zero_()  # type: ignore[operator]
        dense.neighbours.back[2].bias.zero_()  # type: ignore[operator]
        torch.testing.assert_close(dense(example.inputs)[-1].mean_m, without.mean_m)
    assert ModelConfig.from_dict(dense.config.to_dict()) == dense.config


def test_two_corpora_at_once(data: TrainingData) -> None:
    both = MixedData(data, replace(data), 0.5)
    example = both.example(np.array([0, len(data.store)]), CPU)
    assert example.neighbour_m is not None
    assert torch.equal(example.neighbour_m[0].nan_to_num(), example.neighbour_m[1].nan_to_num())


def test_training_with_it(corpus: Corpus, tmp_path: Path) -> None:
    settings = {"spec": SPEC, "max_steps": 4, "batch_size": 16, "accelerator": "cpu", "cache": tmp_path / "cache"}
    model = train(corpus, dense=True, out=tmp_path / "dense", **settings)  # type: ignore[arg-type]
    plain = train(corpus, out=tmp_path / "plain", **settings)  # type: ignore[arg-type]
    task = task_of(make_scene(seed=50), 40)
    again = load(tmp_path / "dense")
    assert again.config.dense
    assert again.predict([task])[0].mode_m.tobytes() == model.predict([task])[0].mode_m.tobytes()
    assert plain.network.neighbours is None
