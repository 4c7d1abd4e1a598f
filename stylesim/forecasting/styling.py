"""The samples of a training with their style, and the network's configuration for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from stylesim.corpus import Corpus
from stylesim.forecasting.conditioner import Judges, StyleCond, StyleConditioner, fit_conditioner
from stylesim.forecasting.conditioning import NULL
from stylesim.forecasting.conditions import NO_CONDITION, condition_of
from stylesim.forecasting.config import InputConfig, ModelConfig
from stylesim.forecasting.data import TrainingData
from stylesim.forecasting.samples import SPLITS, Progress, windows
from stylesim.forecasting.store import SampleStore
from stylesim.forecasting.style_vector import style_parameters
from stylesim.windows import WindowSpec


def styled_data(
    corpora: Sequence[Corpus],
    condition: str,
    spec: WindowSpec,
    stores: Sequence[SampleStore],
    inputs: InputConfig,
    judges: Judges | None,
    *,
    seed: int,
    begin: Callable[[str], Progress | None],
) -> tuple[StyleConditioner | None, list[TrainingData]]:
    """The conditioner fitted on the training split, and the samples of each corpus with their style.

    The first corpus alone has validation samples, and labellers are fitted on it alone. `begin` is told what begins,
    and gives what counts for it.
    """
    conditioner = None
    style: StyleCond = np.full((sum(map(len, stores)), 3), NULL, np.int64)
    if condition != NO_CONDITION:
        if judges is None:
            from stylesim.forecasting.judging import LabelerJudges

            told = begin("fitting labellers")
            judges = LabelerJudges.fit(condition_of(condition).method, corpora[0].split("train"), spec, progress=told)
        told = begin("judging histories")
        asked = chain.from_iterable(windows(corpus, spec, progress=told) for corpus in corpora)
        conditioner, style = fit_conditioner(condition, judges, asked, seed=seed)
    needed = SPLITS, SPLITS[:1]
    cut = np.split(style, np.cumsum([len(store) for store in stores])[:-1])
    return conditioner, [
        TrainingData(store, rows, inputs, needed=need) for store, rows, need in zip(stores, cut, needed, strict=False)
    ]


def with_styles(config: ModelConfig, conditioner: StyleConditioner | None) -> ModelConfig:
    """The configuration with that style, and with as many parameters for it as any condition needs."""
    settings: dict[str, Any] = {} if conditioner is None else conditioner.network_settings()
    equal = style_parameters(config, classes=settings.get("styles", 0))
    return replace(config, **settings, style_parameters=equal)
