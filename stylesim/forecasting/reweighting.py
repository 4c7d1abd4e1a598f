"""The sampling weights, groups and loss weights that `RobustSettings` ask for, given the training data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int64

from stylesim.corpus import Corpus
from stylesim.forecasting.data import TrainingData
from stylesim.forecasting.devices import Runtime
from stylesim.forecasting.groups import balanced_weights, drawn_shares, sample_groups
from stylesim.forecasting.loop import Loop, TrainSettings
from stylesim.forecasting.mixing import TrainingSet
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.robust import RobustSettings
from stylesim.forecasting.validation import BATCH, min_fde_m
from stylesim.forecasting.weighing import GroupDRO, Mean, Weigher, WorstShare

Progress = Callable[[int, int], None]


def with_groups(
    data: TrainingSet, corpora: Sequence[Corpus], settings: RobustSettings
) -> tuple[TrainingSet, tuple[str, ...]]:
    """The data with the group of each sample, and drawn in equal shares of them; the names of the groups.

    `corpora` belong to `data.parts`. Within a part, since how much of a batch comes from it is decided elsewhere.
    InputError where a corpus has no track labels of that method.
    """
    pairs = [(corpus, part.store) for corpus, part in zip(corpora, data.parts, strict=True)]
    groups = sample_groups(pairs, settings.by)
    parts = []
    for part, group in zip(data.parts, groups, strict=True):
        sampling = balanced_weights(part.weight, group.number[part.split(0)], group.names)
        parts.append(replace(part, group=group.number, sampling=sampling))
    return data.with_parts(parts), groups[0].names


def loss_weigher(settings: RobustSettings, data: TrainingSet, groups: Sequence[str]) -> Weigher:
    """What the loop shall minimise; `groups` are the names that `with_groups` gave."""
    if "cvar" in settings.methods:
        return WorstShare(settings.cvar_share)
    if "group_dro" not in settings.methods:
        return Mean()
    share = _shares(data, len(groups))
    return GroupDRO(share, step=settings.dro_step, memory=settings.dro_memory)


def group_report(data: TrainingSet, groups: Sequence[str], weigher: Weigher) -> dict[str, Any]:
    """Of each group: its training samples, its share of the draws, and its weight in GroupDRO (None without)."""
    report: dict[str, Any] = {}
    for number, name in enumerate(groups):
        samples = sum(int((part.group == number).sum()) for part in data.parts if part.group is not None)
        drawn = _shares(data, len(groups))[number]
        weight = float(weigher.q[number]) if isinstance(weigher, GroupDRO) else None
        report[name] = {"samples": samples, "share_drawn": float(drawn), "weight": weight}
    return report


def _shares(data: TrainingSet, groups: int) -> Float64[np.ndarray, " group"]:
    """Which share of the draws each group has."""
    share = np.zeros(groups)
    for part, part_share in zip(data.parts, data.drawn_share, strict=True):
        if part.group is None:
            raise ValueError("the samples have no groups")
        share += part_share * drawn_shares(part.weight, part.group[part.split(0)], groups)
    return share


def identified(
    data: TrainingSet,
    network: ForecastNetwork,
    settings: TrainSettings,
    robust: RobustSettings,
    *,
    runtime: Runtime,
    folder: Path,
    progress: Progress | None = None,
) -> TrainingSet:
    """The data with what a briefly trained `network` forecasts worst drawn `jtt_weight` times as often (JTT).

    The worst are the share `jtt_share` of the training samples with the greatest minFDE (of each part, where there are
    two). `folder` keeps the first training, so that an interrupted one goes on.
    """
    folder.mkdir(parents=True, exist_ok=True)
    brief = replace(settings, epochs=robust.jtt_epochs, patience=robust.jtt_epochs)
    loop = Loop(network, data, brief, runtime=runtime, folder=folder)
    loop.restore()
    loop.run(progress)
    parts = []
    for part in data.parts:
        index = part.split(0)
        error = _errors(network, part, index, runtime.device)
        sampling = part.weight * np.where(worst(error, robust.jtt_share), robust.jtt_weight, 1.0)
        parts.append(replace(part, sampling=sampling))
    return data.with_parts(parts)


def worst(error: Float32[np.ndarray, " row"], share: float) -> np.ndarray:
    """True for the `share` of the rows with the greatest errors; of equal ones, the first."""
    order = np.argsort(-error, kind="stable")
    chosen = np.zeros(len(error), bool)
    chosen[order[: round(share * len(error))]] = True
    return chosen


def _errors(
    network: ForecastNetwork, data: TrainingData, index: Int64[np.ndarray, " row"], device: torch.device
) -> Float32[np.ndarray, " row"]:
    network.eval()
    with torch.no_grad():
        parts = [
            min_fde_m(network, data.example(part, device)).cpu().numpy()
            for part in np.split(index, range(BATCH, len(index), BATCH))
        ]
    return np.concatenate(parts)
