"""`StyleConditioner`: from a history to `style_cond`, with all that was fitted; JSON in the checkpoint. No torch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Int32, Int64

from stylesim.forecasting.conditioning import Measured, StyleCells
from stylesim.forecasting.samples import SPLITS, Window
from stylesim.randomness import stream
from stylesim.scene import Scene

CLUSTERS, CONTEXTS = 3, 2  # REFERENCE section 4: K = 3 [ours]; highway, non-highway [paper]


@runtime_checkable
class Judges(Protocol):
    """Fitted labellers that a history is shown to (`judging.LabelerJudges`; a test may have its own)."""

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the styles."""
        ...

    def measure(self, history: Scene, agent_index: Int32[np.ndarray, " driver"]) -> Measured:
        """What the history says of these agents; the scene comes from `Scene.history`."""
        ...

    def to_dict(self) -> Mapping[str, Any]:
        """As plain JSON types."""
        ...


@dataclass(frozen=True, eq=False)
class StyleConditioner:
    """From a history to (z, k, c)."""

    condition: str
    judges: Judges
    cells: StyleCells

    def style_cond(
        self, history: Scene, agent_index: Int32[np.ndarray, " driver"], *, style: str | None = None
    ) -> Int64[np.ndarray, "driver 3"]:
        """(z, k, c) of these agents, -1 for the null token; with `style`, as if each of them were of that class."""
        asked = None if style is None else self.cells.class_index(style)
        return self.cells.assign(self.judges.measure(history, agent_index), style=asked)

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {"condition": self.condition, "judges": dict(self.judges.to_dict()), "cells": self.cells.to_dict()}


def fit_conditioner(
    condition: str, judges: Judges, sample_windows: Iterable[Window], *, seed: int
) -> tuple[StyleConditioner, Int64[np.ndarray, "sample 3"]]:
    """The conditioner, its clusters fitted on the training windows, and (z, k, c) of every sample.

    The windows come in the order of the sample store; those of other splits are judged, never fitted on.
    """
    parts, is_train = [], []
    for window in sample_windows:
        parts.append(judges.measure(window.history, window.targets))
        is_train.append(np.full(len(window.targets), window.split == SPLITS[0]))
    measured = Measured.joined(parts)
    training = measured.rows(np.concatenate([np.zeros(0, bool), *is_train]))
    rng = stream(seed, 0, "", "style clusters")
    cells = StyleCells.fit(training, judges.classes, clusters=CLUSTERS, contexts=CONTEXTS, rng=rng)
    return StyleConditioner(condition, judges, cells), cells.assign(measured)
