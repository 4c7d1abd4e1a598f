"""The training loop: steps, validation, early stopping, checkpoints from which it continues identically."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stylesim.errors import InputError, StylesimError
from stylesim.forecasting.checkpoint import read_tensors, write_tensors
from stylesim.forecasting.devices import Runtime
from stylesim.forecasting.mixing import TrainingSet
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.neighbours import neighbour_loss
from stylesim.forecasting.objective import mixture_loss, responsible_query
from stylesim.forecasting.style_embedding import style_parameter_groups
from stylesim.forecasting.validation import validated
from stylesim.forecasting.weighing import Mean, Weigher
from stylesim.randomness import stream

STATE_FILE = "state.pt"
FORMAT, VERSION = "stylesim-training", 3
CLIP_NORM = 5.0  # chosen: above what a healthy step has, so that it only catches outliers
WARM_UP_SHARE = 0.05  # of all steps; chosen as is common


@dataclass(frozen=True)
class TrainSettings:
    """How to train; all of it is written beside the model."""

    seed: int = 0
    epochs: int = 30
    max_steps: int | None = None
    batch_size: int = 32
    lr: float = 1e-3
    weight_decay: float = 0.01
    patience: int = 8

    def __post_init__(self) -> None:
        """Refuse what cannot be trained with."""
        for name in ("epochs", "batch_size", "lr", "patience"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} must be positive, not {getattr(self, name)}")
        if self.max_steps is not None and self.max_steps < 1:
            raise InputError(f"max_steps must be 1 or more, not {self.max_steps}")
        if self.weight_decay < 0:
            raise InputError(f"weight_decay must not be negative, not {self.weight_decay}")


class Loop:
    """One training run in a folder of its own."""

    def __init__(
        self,
        network: ForecastNetwork,
        data: TrainingSet,
        settings: TrainSettings,
        *,
        runtime: Runtime,
        folder: Path,
        weigher: Weigher | None = None,
    ) -> None:
        self.weigher = weigher or Mean()
        self.data, self.settings, self.runtime, self.folder = data, settings, runtime, folder
        groups = style_parameter_groups(network, lr=settings.lr, weight_decay=settings.weight_decay)
        self.network = network
        self.forward, self.optimizer = runtime.setup(network, torch.optim.AdamW(groups, fused=True))
        self.peak_lr = [group["lr"] for group in self.optimizer.param_groups]
        per_epoch = len(self._batches(0))
        whole = settings.epochs * per_epoch
        self.total_steps = whole if settings.max_steps is None else min(whole, settings.max_steps)
        self.epoch, self.step = 0, 0
        self.curve: list[dict[str, float]] = []
        self.best: dict[str, Any] = {}
        self.best_epoch = -1

    def run(self, progress: Callable[[int, int], None] | None = None) -> None:
        """Train until the last epoch or step, or until validation has not improved for `patience` epochs.

        Afterwards the network holds the weights of the best epoch. StylesimError if the loss is no number.
        """
        while not self.finished:
            with torch.random.fork_rng():
                torch.manual_seed(int(stream(self.settings.seed, self.epoch, "", "training").integers(2**62)))
                loss = self._train_epoch(progress)
            self._close_epoch(loss)
        if progress is not None:
            progress(self.total_steps, self.total_steps)
        self.network.load_state_dict(self.best)
        self.network.eval()

    @property
    def finished(self) -> bool:
        """True when there is nothing left to train."""
        waited = self.epoch - 1 - self.best_epoch if self.curve else 0
        return self.step >= self.total_steps or self.epoch >= self.settings.epochs or waited >= self.settings.patience

    def _batches(self, epoch: int) -> list[np.ndarray[Any, np.dtype[np.int64]]]:
        return self.data.epoch(epoch, seed=self.settings.seed, batch_size=self.settings.batch_size)

    def _train_epoch(self, progress: Callable[[int, int], None] | None) -> float:
        self.network.train()
        losses = []
        batches = self._batches(self.epoch)[: self.total_steps - self.step]
        for example in self.data.examples(batches, self.runtime.device):
            self._set_rate()
            anchor = self.network.anchors(example.inputs)
            modes = self.forward(example.inputs, example.style, responsible_query(anchor, example.future_m))
            each = mixture_loss(modes, anchor, example.future_m)
            if modes[-1].neighbour_m is not None and example.neighbour_m is not None:
                each = each + neighbour_loss(modes[-1].neighbour_m, example.neighbour_m)
            loss = self.weigher(each, example.group)
            value = float(loss.detach())
            if not math.isfinite(value):
                raise StylesimError(
                    f"the loss became {value} at step {self.step}; lower the learning rate (now {self.settings.lr:g}) "
                    "or run `stylesim verify` on the corpus"
                )
            self.optimizer.zero_grad()
            self.runtime.backward(loss)
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), CLIP_NORM)
            self.optimizer.step()
            losses.append(value)
            self.step += 1
            if progress is not None:
                progress(self.step, self.total_steps)
        return float(np.mean(losses))

    def _set_rate(self) -> None:
        """Linear warm-up, then half a cosine to zero."""
        warm_up = max(1, round(WARM_UP_SHARE * self.total_steps))
        left = (self.step - warm_up) / max(1, self.total_steps - warm_up)
        factor = (self.step + 1) / warm_up if self.step < warm_up else 0.5 * (1 + math.cos(math.pi * left))
        for group, peak in zip(self.optimizer.param_groups, self.peak_lr, strict=True):
            group["lr"] = factor * peak

    def _close_epoch(self, train_loss: float) -> None:
        measured = validated(self.network, self.data, seed=self.settings.seed, device=self.runtime.device)
        self.curve.append({"epoch": self.epoch, "step": self.step, "train_loss": train_loss, **measured})
        if self.best_epoch < 0 or measured["min_fde_m"] < self.curve[self.best_epoch]["min_fde_m"]:
            self.best_epoch = self.epoch
            self.best = {key: value.detach().clone() for key, value in self.network.state_dict().items()}
        self.epoch += 1
        self._save()

    def _save(self) -> None:
        content = {
            "format": FORMAT,
            "version": VERSION,
            "state": self.network.state_dict(),
            "best": self.best,
            "optimizer": self.optimizer.state_dict(),
            "curve": self.curve,
            "counters": [self.epoch, self.step, self.best_epoch],
            "weigher": self.weigher.state(),
        }
        write_tensors(self.folder / STATE_FILE, content)

    def restore(self) -> None:
        """Continue from the last finished epoch in the folder; from the start where there is none."""
        path = self.folder / STATE_FILE
        if not path.exists():
            return
        content = read_tensors(path, format_name=FORMAT, version=VERSION)
        self.network.load_state_dict(content["state"])
        self.optimizer.load_state_dict(content["optimizer"])
        self.best, self.curve = content["best"], content["curve"]
        self.epoch, self.step, self.best_epoch = content["counters"]
        self.weigher.restore(content["weigher"])
