from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.forecasting import samples
from stylesim.forecasting.data import TrainingData
from stylesim.forecasting.samples import RoadCutter, add_window, compiled, store_key, windows
from stylesim.forecasting.store import MemorySink, SampleStore, StoreBuilder
from stylesim.windows import WindowSpec
from tests.conftest import make_scene

from .made import INPUTS, SPEC, made_corpus


def test_a_compiled_store_holds_every_window_of_train_and_val(tmp_path: Path) -> None:
    corpus = made_corpus(tmp_path / "c")
    store = compiled(corpus, SPEC, INPUTS, tmp_path / "cache")
    expected = list(windows(corpus, SPEC))
    assert len(store) == sum(len(w.targets) for w in expected) > 50
    assert len(store.road_pieces) == 1  # six scenes, one road
    row = 0
    for window in expected:
        for target in window.targets:
            scene, t0, agent, split = store.origin[row]
            assert (scene, t0, agent, split) == (window.scene_number, window.t0, target, window.split == "val")
            future = window.scene.tracks.position_m[target, t0 + 1 : t0 + 31]
            np.testing.assert_array_equal(store.future_m[row], future)
            pose = store.agent_pose[store.sample[row, 1]]
            np.testing.assert_array_equal(pose[:2], window.scene.tracks.position_m[target, t0])
            row += 1


def test_training_and_prediction_see_the_same_bits(tmp_path: Path) -> None:
    corpus = made_corpus(tmp_path / "c", scenes=3)
    store = compiled(corpus, SPEC, INPUTS, tmp_path / "cache")
    sink = MemorySink(INPUTS)
    builder, cutter = StoreBuilder(sink), RoadCutter(INPUTS)
    for window in windows(corpus, SPEC):
        sink.append("sample", add_window(builder, cutter, window.history, window.targets, INPUTS))
    memory = sink.store()
    for field in fields(SampleStore):
        if field.name not in ("origin", "weight", "future_m"):
            assert getattr(memory, field.name).tobytes() == np.asarray(getattr(store, field.name)).tobytes()


def test_compiled_once_and_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    corpus = made_corpus(tmp_path / "c", scenes=3)
    first = compiled(corpus, SPEC, INPUTS, tmp_path / "cache")
    monkeypatch.setattr(samples, "_compile", lambda *_: pytest.fail("compiled again"))
    assert len(compiled(corpus, SPEC, INPUTS, tmp_path / "cache")) == len(first)
    assert [p.name for p in (tmp_path / "cache").iterdir()] == [f"samples-{store_key(corpus, SPEC, INPUTS)}"]


def test_an_interrupted_compilation_leaves_nothing(tmp_path: Path) -> None:
    corpus = made_corpus(tmp_path / "c", scenes=3)

    def interrupt(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compiled(corpus, SPEC, INPUTS, tmp_path / "cache", progress=interrupt)
    assert list((tmp_path / "cache").iterdir()) == []


def test_the_key_changes_with_windows_inputs_and_scenes(tmp_path: Path) -> None:
    corpus = made_corpus(tmp_path / "c", scenes=3)
    keys = {
        store_key(corpus, SPEC, INPUTS),
        store_key(corpus, WindowSpec(2.0, 3.0, 2.0), INPUTS),
        store_key(corpus, SPEC, replace(INPUTS, agents=8)),
        store_key(corpus.with_info(corpus.info[1:]), SPEC, INPUTS),
    }
    assert len(keys) == 4


def weighted(folder: Path) -> Corpus:
    with CorpusWriter(folder, source="made", configuration={}) as writer:
        writer.add(make_scene("a", n_frames=90), split="train")
        writer.add(make_scene("b", n_frames=90, seed=1), split="val")
        weights = {("a", f"car-{i}"): 1.0 for i in range(5)} | {("a", "car-1"): 6.0}
        return writer.finish(weights=weights)


def data_of(corpus: Corpus, cache: Path) -> TrainingData:
    store = compiled(corpus, SPEC, INPUTS, cache)
    return TrainingData(store, np.full((len(store), 3), -1, np.int64), INPUTS)


def test_heavier_drivers_are_drawn_more_often(tmp_path: Path) -> None:
    data = data_of(weighted(tmp_path / "c"), tmp_path / "cache")
    drawn = np.concatenate([np.concatenate(data.epoch(e, seed=0, batch_size=8)) for e in range(200)])
    assert set(drawn) <= set(data.split(0))
    agent = data.store.origin[drawn, 2]
    ratio = (agent == 1).mean() / (agent == 0).mean()
    assert 4.5 < ratio < 8.0


def test_a_driver_without_weight_gets_the_mean_and_is_counted_aloud(tmp_path: Path) -> None:
    with CorpusWriter(tmp_path / "c", source="made", configuration={}) as writer:
        writer.add(make_scene("a", n_frames=90), split="train")
        writer.add(make_scene("b", n_frames=90, seed=1), split="val")
        corpus = writer.finish(weights={("a", "car-0"): 1.0, ("a", "car-1"): 3.0, ("b", "car-0"): 99.0})
    data = data_of(corpus, tmp_path / "cache")
    agent = data.store.origin[data.split(0), 2]
    missing = int((agent > 1).sum())
    assert data.without_weight == missing > 0
    with pytest.warns(UserWarning, match=f"{missing} of {len(agent)} training samples have no sampling weight"):
        weight = data.weight
    usual = weight[agent <= 1].mean()
    assert set(weight[agent > 1]) == {usual}
    assert set(weight[agent == 1]) == {3.0}


def test_weights_of_other_scenes_are_refused(tmp_path: Path) -> None:
    with CorpusWriter(tmp_path / "c", source="made", configuration={}) as writer:
        writer.add(make_scene("a", n_frames=90), split="train")
        writer.add(make_scene("b", n_frames=90, seed=1), split="val")
        corpus = writer.finish(weights={("elsewhere", "car-0"): 1.0})
    with pytest.raises(InputError, match="for none of its"):
        data_of(corpus, tmp_path / "cache").epoch(0, seed=0, batch_size=8)


def test_weights_that_came_later_are_not_taken_from_the_cache(tmp_path: Path) -> None:
    corpus = weighted(tmp_path / "c")
    before = data_of(corpus, tmp_path / "cache")
    corpus.write_weights({("a", f"car-{i}"): 1.0 + i for i in range(5)}, by="tdbm")
    after = data_of(Corpus(tmp_path / "c"), tmp_path / "cache")
    assert sorted(set(before.weight)) == [1.0, 6.0]
    assert sorted(set(after.weight)) == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_with_equal_weights_an_epoch_takes_each_sample_once(tmp_path: Path) -> None:
    data = data_of(made_corpus(tmp_path / "c"), tmp_path / "cache")
    batches = data.epoch(0, seed=0, batch_size=1)
    assert sorted(np.concatenate(batches)) == sorted(data.split(0))
    assert [b.tolist() for b in data.epoch(0, seed=0, batch_size=1)] == [b.tolist() for b in batches]
    assert [b.tolist() for b in data.epoch(1, seed=0, batch_size=1)] != [b.tolist() for b in batches]
    ranks = [data.epoch(0, seed=0, batch_size=1, rank=r, world=2) for r in range(2)]
    assert sorted(np.concatenate(ranks[0] + ranks[1])) == sorted(data.split(0))


def test_a_split_without_samples_is_named(tmp_path: Path) -> None:
    corpus = made_corpus(tmp_path / "c", scenes=3, n_frames=40)
    with pytest.raises(InputError, match="split 'train' has no agent"):
        data_of(corpus, tmp_path / "cache")
