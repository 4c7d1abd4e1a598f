"""Where training runs changes nothing but the arithmetic."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import nn

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.forecasting.checkpoint import load
from stylesim.forecasting.devices import FabricRuntime, PlainRuntime, runtime
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.training import train

from .made import SPEC, weights

pytest.importorskip("lightning_fabric")


def trained(corpus: Corpus, cache: Path, out: Path, **options: Any) -> TrainedForecaster:
    settings = {"spec": SPEC, "max_steps": 5, "batch_size": 16, "accelerator": "cpu", "dense": True}
    return train(corpus, out=out, cache=cache, **{**settings, **options})


@pytest.fixture(scope="module")
def plain(corpus: Corpus, cache: Path, tmp_path_factory: pytest.TempPathFactory) -> TrainedForecaster:
    return trained(corpus, cache, tmp_path_factory.mktemp("plain") / "m")


def test_through_fabric_the_same_weights_come_out(
    corpus: Corpus, cache: Path, tmp_path: Path, plain: TrainedForecaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fabric(*_: object, **__: object) -> FabricRuntime:
        return FabricRuntime(accelerator="cpu", precision="32-true")

    monkeypatch.setattr("stylesim.forecasting.training.runtime", fabric)
    assert weights(trained(corpus, cache, tmp_path / "m")) == weights(plain)


def test_half_precision_learns_much_the_same_into_float32_weights(
    corpus: Corpus, cache: Path, tmp_path: Path, plain: TrainedForecaster
) -> None:
    half = trained(corpus, cache, tmp_path / "m", precision="bf16-mixed")
    assert weights(half) != weights(plain)
    assert {p.dtype for p in half.network.parameters()} == {torch.float32}
    losses = [model.training_curve[-1]["val_loss"] for model in (half, plain)]
    assert losses[0] == pytest.approx(losses[1], abs=0.05)


def test_what_is_compiled_is_the_network(
    corpus: Corpus, cache: Path, tmp_path: Path, plain: TrainedForecaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[nn.Module] = []

    def compile_nothing(module: nn.Module, **_: object) -> nn.Module:
        seen.append(module)
        return module

    monkeypatch.setattr(torch, "compile", compile_nothing)
    assert weights(trained(corpus, cache, tmp_path / "m", compiled=True)) == weights(plain)
    assert len(seen) == 1
    assert sum(p.numel() for p in seen[0].parameters()) == sum(p.numel() for p in plain.network.parameters())


@pytest.mark.slow
def test_compiled_for_real(corpus: Corpus, tmp_path: Path, plain: TrainedForecaster) -> None:
    """In a process of its own: the compiler warns of itself, and cannot see through the type checks of the tests.

    Dropout draws other numbers there, so only the level of the loss can be compared.
    """
    options = [
        "--history",
        "2",
        "--future",
        "3",
        "--stride",
        "1.5",
        "--max-steps",
        "5",
        "--batch-size",
        "16",
        "--dense",
    ]
    command = ["train", str(corpus.path), *options, "--accelerator", "cpu", "--compile", "--out", str(tmp_path / "m")]
    start = "from stylesim.cli.main import main; main()"
    subprocess.run([sys.executable, "-c", start, *command], check=True, timeout=1200)
    model = load(tmp_path / "m")
    assert model.training_curve[-1]["val_loss"] == pytest.approx(plain.training_curve[-1]["val_loss"], abs=0.1)


def test_what_cannot_be_had_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert isinstance(runtime(), PlainRuntime)
    with pytest.raises(InputError, match="no GPU"):
        runtime("gpu")
    with pytest.raises(InputError, match="bf16-mixed"):
        runtime("cpu", "bf16")
    with pytest.raises(InputError, match="cpu"):
        runtime("tpu")
