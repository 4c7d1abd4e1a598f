"""What a labeller must be able to do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Int

from stylesim.labels import StyleLabels
from stylesim.scene import Scene

Progress = Callable[[int, int], None]  # done, total (0 if it is not known)


@runtime_checkable
class Labeler(Protocol):
    """Tells the style of drivers. It follows scikit-learn's habits and knows no simulator.

    The constructor stores its parameters untouched; `fit` returns self; what it learns ends in `_`. A labeller that
    was written to JSON and read again gives the same bits. `history_s` are the lengths of histories that it can judge.
    """

    history_s: Sequence[float]

    @property
    def method(self) -> str:
        """Its name in file names and in `StyleLabels.method`."""
        ...

    def fit(self, scenes: Iterable[Scene], *, progress: Progress | None = None) -> Labeler:
        """Learn scalers, clusters, whatever it needs, from scenes of a reference population (a Corpus is such)."""
        ...

    def label_windows(
        self,
        scene: Scene,
        starts: Sequence[int] | None = None,
        length_steps: int | None = None,
        *,
        span: str = "track",
        agents: Int[np.ndarray, " driver"] | None = None,
    ) -> StyleLabels:
        """Labels of one scene.

        Span "track": one row per driver, the mean of its windows: its own side by side where `starts` is None, else
        those of `length_steps` frames that begin at `starts`. Span "history": one row per start and driver, from
        nothing but `scene.history(start + length_steps - 1, length_steps)`; a start is negative where the scene is
        shorter than the history. `agents` None: every motor vehicle seen (track) or seen at t0 (history).
        """
        ...

    def to_dict(self) -> dict[str, Any]:
        """Parameters and what was learned, as JSON-able values."""
        ...

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> Labeler:
        """The labeller that `to_dict` described."""
        ...
