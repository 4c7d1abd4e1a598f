from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from stylesim.corpus import Corpus
from stylesim.errors import CorpusError, InputError, StylesimError
from stylesim.forecasting import checkpoint, training
from stylesim.forecasting.checkpoint import MODEL_FILE, load
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.loop import STATE_FILE
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.training import RECORD_FILE, train
from tests.conftest import make_scene

from .made import SPEC, task_of, weights


def trained(corpus: Corpus, out: Path, cache: Path, **changes: Any) -> TrainedForecaster:
    settings = {"spec": SPEC, "epochs": 2, "batch_size": 16, "seed": 3, "accelerator": "cpu"}
    return train(corpus, out=out, cache=cache, **{**settings, **changes})


@pytest.fixture(scope="module")
def straight(corpus: Corpus, cache: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[TrainedForecaster, Path]:
    out = tmp_path_factory.mktemp("straight") / "model"
    return trained(corpus, out, cache), out


def test_a_folder_with_model_and_loss_curve(straight: tuple[TrainedForecaster, Path]) -> None:
    model, out = straight
    assert sorted(p.name for p in out.iterdir()) == [MODEL_FILE, RECORD_FILE]
    assert not out.with_name("model.partial").exists()
    record = json.loads((out / RECORD_FILE).read_text())
    assert [row["epoch"] for row in record["curve"]] == [0, 1]
    assert record["curve"][1]["train_loss"] < record["curve"][0]["train_loss"]
    assert {"val_loss", "min_fde_m", "min_ade_m", "brier_fde_m"} <= set(record["curve"][0])
    assert record["parameters"] == sum(p.numel() for p in model.network.parameters())
    assert model.name == "tiny"


def test_a_checkpoint_predicts_what_was_trained(straight: tuple[TrainedForecaster, Path]) -> None:
    model, out = straight
    task = task_of(make_scene(seed=50), 40)
    for path in (out, out / MODEL_FILE):
        again = load(path)
        assert again.predict([task])[0].mode_m.tobytes() == model.predict([task])[0].mode_m.tobytes()


def test_the_same_seed_gives_the_same_weights_also_after_an_interruption(
    corpus: Corpus, straight: tuple[TrainedForecaster, Path], cache: Path, tmp_path: Path
) -> None:
    before = torch.random.get_rng_state()

    def interrupt(step: int, total: int) -> None:
        if step > total // 2 + 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trained(corpus, tmp_path / "m", cache, progress=interrupt)
    partial = tmp_path / "m.partial"
    assert sorted(p.name for p in partial.iterdir()) == [STATE_FILE, RECORD_FILE]
    assert not (tmp_path / "m").exists()
    resumed = trained(corpus, tmp_path / "m", cache, resume=True)
    assert weights(resumed) == weights(straight[0])
    assert weights(trained(corpus, tmp_path / "m", cache, resume=True)) == weights(resumed)  # finished: only loaded
    other = trained(corpus, tmp_path / "other", cache, seed=4)
    assert weights(other) != weights(resumed)
    assert torch.equal(torch.random.get_rng_state(), before)


def test_what_lies_there_is_not_overwritten_or_mixed(
    corpus: Corpus, straight: tuple[TrainedForecaster, Path], cache: Path
) -> None:
    with pytest.raises(InputError, match="is there already"):
        trained(corpus, straight[1], cache)
    with pytest.raises(InputError, match="trained with settings"):
        trained(corpus, straight[1], cache, lr=0.5, resume=True)


def test_max_steps_ends_it(corpus: Corpus, cache: Path, tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    trained(corpus, tmp_path / "m", cache, max_steps=3, progress=lambda done, total: steps.append((done, total)))
    assert steps[-1] == (3, 3)


def test_early_stopping_keeps_the_best(
    corpus: Corpus, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scores = iter([3.0, 1.0, 2.0, 2.0, 0.0])
    monkeypatch.setattr("stylesim.forecasting.loop.validated", lambda *_, **__: {"min_fde_m": next(scores)})
    trained(corpus, tmp_path / "m", cache, epochs=9, patience=2, lr=1e-4)
    record = json.loads((tmp_path / "m" / RECORD_FILE).read_text())
    assert record["best_epoch"] == 1
    assert len(record["curve"]) == 4


def test_a_loss_that_is_no_number_stops_with_advice(corpus: Corpus, cache: Path, tmp_path: Path) -> None:
    with pytest.raises(StylesimError, match="lower the learning rate"):
        trained(corpus, tmp_path / "m", cache, lr=1e12)
    assert not (tmp_path / "m").exists()


def test_a_corpus_without_splits_is_told_to_merge(tmp_path: Path, cache: Path) -> None:
    from stylesim.corpus import CorpusWriter

    with CorpusWriter(tmp_path / "c", source="made", configuration={}) as writer:
        writer.add(make_scene())
        plain = writer.finish()
    with pytest.raises(InputError, match="stylesim merge"):
        trained(plain, tmp_path / "m", cache)


@pytest.mark.parametrize(
    "changes", [{"condition": "tdmb"}, {"fusion": "erly"}, {"size": "huge"}, {"reading": "R6"}, {"epochs": 0}]
)
def test_wrong_settings_leave_nothing(corpus: Corpus, cache: Path, tmp_path: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        trained(corpus, tmp_path / "m", cache, **changes)
    assert list(tmp_path.iterdir()) == []


class Evil:
    def __reduce__(self) -> tuple[Any, ...]:
        return (print, ("code ran",))


def test_checkpoints_that_are_not_ours_are_refused(
    tmp_path: Path, straight: tuple[TrainedForecaster, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    content = torch.load(straight[1] / MODEL_FILE, weights_only=True)
    whole = (straight[1] / MODEL_FILE).read_bytes()
    bad: dict[str, Any] = {
        "text": b"hello",
        "empty": b"",
        "cut": whole[: len(whole) // 2],
        "code": {**content, "extra": Evil()},
        "other": {"weight": torch.zeros(3)},
        "newer": {**content, "version": 99},
        "older": {**content, "version": 1},
        "lacking": {**content, "state": {}},
        "odd": {**content, "config": '{"width": 64}'},
        "tensor": torch.zeros(3),
    }
    for name, what in bad.items():
        path = tmp_path / f"{name}.pt"
        if isinstance(what, bytes):
            path.write_bytes(what)
        else:
            torch.save(what, path)
        with pytest.raises(InputError, match=str(path)):
            load(path)
    assert "code ran" not in capsys.readouterr().out
    with pytest.raises(InputError, match="stylesim train"):
        load(tmp_path / "nowhere")


def test_a_full_disk_leaves_the_old_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "state.pt"
    checkpoint.write_tensors(path, {"format": "x", "version": 1, "a": torch.ones(2)})
    before = path.read_bytes()

    def full(*_: Any) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(CorpusError, match="disk is full"):
        checkpoint.write_tensors(path, {"format": "x", "version": 1, "a": torch.zeros(2)})
    assert path.read_bytes() == before


def test_intentions_come_from_the_training_split(straight: tuple[TrainedForecaster, Path]) -> None:
    network = straight[0].network
    assert isinstance(network, ForecastNetwork)
    spread = network.intention_mps2.numpy().std(axis=1)
    assert np.isfinite(spread).all()
    assert (spread[:, 0] > 0.01).all()
    assert training.RECORD_FILE == RECORD_FILE
