"""The options for rare drivers, through groups, batches and whole trainings."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.forecasting import reweighting
from stylesim.forecasting.augmenting import added_view
from stylesim.forecasting.checkpoint import MODEL_FILE
from stylesim.forecasting.data import TrainingData
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.groups import NO_GROUP, SMALL, balanced_weights, sample_groups
from stylesim.forecasting.mixing import MixedData
from stylesim.forecasting.reweighting import group_report, loss_weigher, with_groups, worst
from stylesim.forecasting.robust import RobustSettings
from stylesim.forecasting.samples import compiled
from stylesim.forecasting.training import RECORD_FILE, train
from tests.conftest import make_scene

from .made import INPUTS, SPEC, made_corpus, with_style_labels


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("robust")


@pytest.fixture(scope="module")
def corpus(folder: Path) -> Corpus:
    return with_style_labels(made_corpus(folder / "base", scenes=12))


@pytest.fixture(scope="module")
def more(folder: Path) -> Corpus:
    """Generated scenes without splits."""
    with CorpusWriter(folder / "more", source="made", configuration={"other": True}) as writer:
        for number in range(3):
            writer.add(make_scene(f"generated-{number}", n_frames=90, seed=100 + number))
        return with_style_labels(writer.finish())


def data_of(corpus: Corpus, folder: Path, needed: tuple[str, ...] = ("train", "val")) -> TrainingData:
    store = compiled(corpus, SPEC, INPUTS, folder / "cache")
    return TrainingData(store, np.full((len(store), 3), -1, np.int64), INPUTS, needed=needed)


def mixed(corpus: Corpus, more: Corpus, folder: Path, share: float) -> MixedData:
    view = added_view(corpus, more, share).corpus
    return MixedData(data_of(corpus, folder), data_of(view, folder, ("train",)), share)


def test_groups_are_style_and_context_of_training_samples_only(corpus: Corpus, folder: Path) -> None:
    data = data_of(corpus, folder)
    (groups,) = sample_groups([(corpus, data.store)], "tdbm")
    names = dict(enumerate(groups.names)) | {NO_GROUP: "-"}
    expected = {0: "aggressive, elsewhere", 1: "undetermined", 2: "careful, highway", 3: "careful, elsewhere"}
    expected[4] = SMALL if SMALL in groups.names else "careful, elsewhere"
    for number, (_, _, agent, split) in zip(groups.number, data.store.origin, strict=True):
        assert names[int(number)] == ("-" if split else expected[int(agent)])


def test_small_groups_are_thrown_together(corpus: Corpus, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stylesim.forecasting.groups.LEAST_IN_CELL", 40)
    (groups,) = sample_groups([(corpus, data_of(corpus, folder).store)], "tdbm")
    assert groups.names[-1] == SMALL
    assert len(groups.names) < 4


def test_balanced_groups_are_drawn_equally_often(corpus: Corpus, folder: Path) -> None:
    data, names = with_groups(data_of(corpus, folder), [corpus], RobustSettings.of("balanced"))
    drawn = np.concatenate([np.concatenate(data.epoch(e, seed=0, batch_size=8)) for e in range(60)])
    assert isinstance(data, TrainingData)
    assert data.group is not None
    known = [n for n, name in enumerate(names) if name != "undetermined"]
    share = np.array([(data.group[drawn] == n).mean() for n in known])
    np.testing.assert_allclose(share, share.mean(), atol=0.02)
    report = group_report(data, names, loss_weigher(RobustSettings.of("balanced"), data, names))
    np.testing.assert_allclose([report[names[n]]["share_drawn"] for n in known], share, atol=0.02)


def test_no_row_is_repeated_without_bound_and_unknown_styles_keep_their_weight() -> None:
    group = np.array([0] * 100 + [1] + [2] * 5)
    weight = balanced_weights(np.ones(106), group, ("common", "rare", "undetermined"))
    assert set(weight[:100]) == {0.505}
    assert weight[100] == 20.0
    assert set(weight[101:]) == {1.0}
    within = balanced_weights(np.array([1.0, 3.0, 1.0, 1.0]), np.array([0, 0, 1, 1]), ("a", "b"))
    np.testing.assert_allclose(within, [0.75, 2.25, 1.5, 1.5])


def test_a_corpus_without_labels_is_told_to_label(folder: Path, tmp_path: Path) -> None:
    plain = made_corpus(tmp_path / "plain", scenes=3)
    with pytest.raises(InputError, match="stylesim label"):
        train(plain, spec=SPEC, out=tmp_path / "m", cache=folder / "cache", robust="balanced", accelerator="cpu")


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 1.0])
def test_every_batch_has_its_share_of_added_samples(corpus: Corpus, more: Corpus, folder: Path, share: float) -> None:
    data = mixed(corpus, more, folder, share)
    alone, batches = data.base.epoch(0, seed=1, batch_size=8), data.epoch(0, seed=1, batch_size=8)
    assert [len(b) for b in batches] == [len(b) for b in alone]
    added = np.array([(b >= len(data.base.store)).sum() for b in batches])
    assert abs(added - 8 * share).max() < 1
    assert abs(added.sum() - 8 * share * len(batches)) < 1
    assert set(np.concatenate(batches)) <= set(data.split(0))
    assert [b.tolist() for b in data.epoch(0, seed=1, batch_size=8)] == [b.tolist() for b in batches]
    ranks = [data.epoch(0, seed=1, batch_size=8, rank=r, world=2) for r in range(2)]
    assert sum(map(len, ranks)) == len(batches)


def test_a_mixed_batch_is_the_batches_of_both(corpus: Corpus, more: Corpus, folder: Path) -> None:
    data = mixed(corpus, more, folder, 0.5)
    device = torch.device("cpu")
    mine, theirs = data.base.split(0)[:3], data.added.split(0)[:2]
    both = data.example(np.concatenate([mine, len(data.base.store) + theirs]), device)
    one, other = data.base.example(mine, device), data.added.example(theirs, device)
    assert torch.equal(both.future_m, torch.cat([one.future_m, other.future_m]))
    assert torch.equal(both.inputs.agent, torch.cat([one.inputs.agent, other.inputs.agent]))
    assert both.group is None


def test_no_future_is_added_that_the_test_split_holds(corpus: Corpus, more: Corpus, tmp_path: Path) -> None:
    with CorpusWriter(tmp_path / "rolled", source="made", configuration={}) as writer:
        for number, origin in enumerate(("scene-0", "c1-scene-11", "elsewhere")):
            writer.add(replace(make_scene(f"rolled-{number}", n_frames=90), replay_of=origin))
        rolled = writer.finish()
    added = added_view(corpus, rolled, 0.3)  # scene-0 is trained on, scene-11 validates
    assert [info.scene_id for info in added.corpus.info] == ["rolled-0", "rolled-2"]
    assert {info.split for info in added.corpus.info} == {"train"}
    assert added.left_out == added.to_dict()["scenes_left_out"] == 1
    with CorpusWriter(tmp_path / "same", source="made", configuration={"part": True}) as writer:
        writer.add(make_scene("scene-0", n_frames=90, seed=0))  # as it is in the corpus
        writer.add(make_scene("scene-1", n_frames=70, seed=0))  # other driving under a known id
        same = writer.finish()
    assert [info.scene_id for info in added_view(corpus, same, 0.3).corpus.info] == ["scene-1"]
    with pytest.raises(InputError, match="another one"):
        added_view(corpus, corpus, 0.3)
    with pytest.raises(InputError, match="augment_share"):
        added_view(corpus, more, 1.3)


def test_the_worst_share_is_found() -> None:
    assert worst(np.array([1, 5, 3, 5, 0], np.float32), 0.4).tolist() == [False, True, False, True, False]


def trained(corpus: Corpus, out: Path, folder: Path, **changes: Any) -> TrainedForecaster:
    settings = {"spec": SPEC, "epochs": 2, "batch_size": 16, "seed": 3, "accelerator": "cpu"}
    return train(corpus, out=out, cache=folder / "cache", **{**settings, **changes})


def test_jtt_draws_more_of_what_the_first_model_forecasts_worst(
    corpus: Corpus, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(
        reweighting, "_errors", lambda net, data, index, device: (data.store.origin[index, 2] == 2).astype(np.float32)
    )
    before = reweighting.identified

    def watched(*args: Any, **more: Any) -> Any:
        seen.append(before(*args, **more))
        return seen[-1]

    monkeypatch.setattr("stylesim.forecasting.trained_loop.identified", watched)
    trained(corpus, tmp_path / "m", folder, robust=RobustSettings(("jtt",), jtt_share=0.25, jtt_weight=5.0))
    agent = seen[0].store.origin[seen[0].split(0), 2]
    hard = seen[0].sampling > 1
    assert 0.2 < hard.mean() < 0.3
    assert (agent[hard] == 2).mean() > 0.8
    assert set(seen[0].sampling) == {1.0, 5.0}


OPTIONS: list[dict[str, Any]] = [
    {"robust": "group_dro"},
    {"robust": "balanced,cvar"},
    {"robust": "jtt", "epochs": 2},
]


@pytest.mark.parametrize("options", OPTIONS)
def test_an_interrupted_training_goes_on_with_the_same_bytes(
    options: dict[str, Any], corpus: Corpus, more: Corpus, folder: Path, tmp_path: Path
) -> None:
    options = {**options, "augment": more, "augment_share": 0.25}
    straight = trained(corpus, tmp_path / "straight", folder, **options)
    stages: list[str] = []

    def interrupt(step: int, total: int) -> None:
        if stages[-1] == "training" and step > total // 2 + 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trained(corpus, tmp_path / "m", folder, progress=interrupt, stage=stages.append, **options)
    again = trained(corpus, tmp_path / "m", folder, resume=True, **options)
    for key, value in straight.network.state_dict().items():
        assert torch.equal(value, again.network.state_dict()[key]), key
    assert sorted(p.name for p in (tmp_path / "m").iterdir()) == [MODEL_FILE, RECORD_FILE]
    record = json.loads((tmp_path / "m" / RECORD_FILE).read_text())
    assert record == json.loads((tmp_path / "straight" / RECORD_FILE).read_text())
    assert record["samples"]["train_added"] > 0
    assert record["robust"]["methods"] == options["robust"].split(",")
    if options["robust"] == "group_dro":
        weights = [group["weight"] for group in record["groups"].values()]
        assert sum(weights) == pytest.approx(1.0, abs=1e-5)
        assert max(weights) > min(weights)
    with pytest.raises(InputError, match="trained with augment"):
        trained(corpus, tmp_path / "m", folder, resume=True, **{**options, "augment_share": 0.5})
