"""`StyleConditioner`: from a history to `style_cond`, with all that was fitted; JSON in the checkpoint. No torch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64

from stylesim.errors import InputError
from stylesim.forecasting.conditioning import StyleCells
from stylesim.forecasting.conditions import EARLIER_S, Condition, condition_of
from stylesim.forecasting.measured import Measured
from stylesim.forecasting.posterior import StylePosterior
from stylesim.forecasting.random_cells import RandomCells
from stylesim.forecasting.samples import SPLITS, Window
from stylesim.forecasting.truth import Truth
from stylesim.forecasting.vectors import StyleVectors
from stylesim.randomness import stream
from stylesim.scene import Scene
from stylesim.windows import earlier_scene

CLUSTERS, CONTEXTS = 3, 2  # REFERENCE section 4: K = 3 [ours]; highway, non-highway [paper]

# What the network is given of each driver: a cell (z, k, c), -1 for the null token; or a vector, NaN for it.
StyleCond = Int64[np.ndarray, "_ 3"] | Float32[np.ndarray, "_ _"]


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
    """From a history to what the network is given. `cells` is whatever the condition makes of what was measured."""

    condition: str
    judges: Judges
    cells: StyleCells | StyleVectors | RandomCells
    posterior: StylePosterior | None = None

    @property
    def kind(self) -> Condition:
        """What the condition tells, and where it takes it from."""
        return condition_of(self.condition)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the styles that can be asked for."""
        return self._what_if.classes

    @property
    def earlier_s(self) -> float:
        """How many seconds before the history it would like to see."""
        return EARLIER_S if self.kind.span == "earlier" else 0.0

    def style_cond(
        self,
        history: Scene,
        agent_index: Int32[np.ndarray, " driver"],
        *,
        style: str | None = None,
        earlier: Scene | None = None,
        truth: Int64[np.ndarray, " driver"] | None = None,
    ) -> StyleCond:
        """(z, k, c) of these agents, or their vectors; with `style`, as if each of them were of that class.

        `earlier` is what the scene showed before the history, for conditions that look at it; `truth` the true styles,
        for the oracle alone: InputError where it has none.
        """
        seen = measured(self.kind, self.judges, history, agent_index, earlier=earlier)
        if style is not None:
            return self.what_if(seen, style)
        if self.kind.sees_future:
            if truth is None:
                raise InputError("an oracle must be told the true styles")
            seen = seen.with_style(truth)
        if isinstance(self.cells, RandomCells):
            return self.cells.draw(driver_names(history, agent_index))
        return self.cells.assign(seen)

    def what_if(self, seen: Measured, style: str) -> StyleCond:
        """As if each of the drivers were of that class; InputError for an unknown one."""
        return self._what_if.assign(seen, style=self._what_if.class_index(style))

    def what_ifs(
        self, history: Scene, agent_index: Int32[np.ndarray, " driver"], *, earlier: Scene | None = None
    ) -> tuple[list[StyleCond], Float64[np.ndarray, "driver style"]]:
        """For every class, as if each driver were of it; and how likely that is, given the history.

        InputError where no posterior was learned (the judges gave no features, or no whole track had a class).
        """
        if self.posterior is None:
            raise InputError(
                "this model has no posterior of styles to average over: no whole track of its training had a style, "
                "or its judges give no features"
            )
        seen = measured(self.kind, self.judges, history, agent_index, earlier=earlier)
        return [self.what_if(seen, name) for name in self.classes], self.posterior.of(seen)

    @property
    def _what_if(self) -> StyleCells | StyleVectors:
        return self.cells.real if isinstance(self.cells, RandomCells) else self.cells

    def network_settings(self) -> dict[str, int]:
        """What the network's configuration must say."""
        return self._what_if.network_settings()

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {
            "condition": self.condition,
            "judges": dict(self.judges.to_dict()),
            "cells": self.cells.to_dict(),
            "posterior": None if self.posterior is None else self.posterior.to_dict(),
        }


FORMS: dict[str, type[StyleCells] | type[StyleVectors] | type[RandomCells]] = {
    "cells": StyleCells,
    "scores": StyleVectors,
    "features": StyleVectors,
    "random": RandomCells,
}


def driver_names(scene: Scene, agent_index: Int32[np.ndarray, " driver"]) -> list[str]:
    """One name per driver, the same in all scenes of a unit."""
    return [f"{scene.unit_id}/{scene.tracks.agent_id[i]}" for i in agent_index]


def measured(
    condition: Condition,
    judges: Judges,
    history: Scene,
    agent_index: Int32[np.ndarray, " driver"],
    *,
    earlier: Scene | None,
) -> Measured:
    """What is known of these agents at t0: from the history, or also from the windows before it."""
    latest = judges.measure(history, agent_index)
    if condition.span != "earlier" or earlier is None:
        return latest
    steps = history.tracks.n_frames
    ends = range(earlier.tracks.n_frames - 1, steps - 2, -steps)  # whole windows, the latest first
    before = [judges.measure(earlier.history(end, steps), agent_index) for end in ends]
    return Measured.averaged([latest, *before], len(judges.classes))


def fit_conditioner(
    condition: str, judges: Judges, sample_windows: Iterable[Window], *, seed: int
) -> tuple[StyleConditioner, StyleCond]:
    """The conditioner, its clusters or scales fitted on the training windows, and `style_cond` of every sample.

    The windows come in the order of the sample store; those of other splits are judged, never fitted on.
    """
    kind = condition_of(condition)
    truth = Truth(judges, judges.classes, commanded=kind.sees_future)
    earlier_s = EARLIER_S if kind.span == "earlier" else 0.0
    parts: list[Measured] = []
    is_train, drivers, target = [], [], []
    for window in sample_windows:
        before = earlier_scene(window.scene, window.t0, window.history.tracks.n_frames, earlier_s)
        part = measured(kind, judges, window.history, window.targets, earlier=before)
        learns = window.split == SPLITS[0]
        if learns or kind.sees_future:
            true_style = truth.of_scene(window.scene)[window.targets]
            target.append(true_style if learns else np.zeros(0, np.int64))
        parts.append(part.with_style(true_style) if kind.sees_future else part)
        is_train.append(np.full(len(window.targets), learns))
        drivers += driver_names(window.history, window.targets)
    every, training = Measured.joined(parts), np.concatenate([np.zeros(0, bool), *is_train])
    cells, style = _encoded(kind, every, training, drivers, judges.classes, seed)
    rng = stream(seed, 0, "", "style posterior")
    known = np.concatenate([np.zeros(0, np.int64), *target])
    posterior = StylePosterior.fit(every.rows(training), known, judges.classes, rng=rng)
    return StyleConditioner(condition, judges, cells, posterior), style


def _encoded(
    kind: Condition,
    every: Measured,
    is_train: np.ndarray[Any, np.dtype[np.bool_]],
    drivers: Sequence[str],
    classes: tuple[str, ...],
    seed: int,
) -> tuple[StyleCells | StyleVectors | RandomCells, StyleCond]:
    """What the condition makes of the samples, fitted on those of the training split."""
    training = every.rows(is_train)
    if kind.form in ("scores", "features"):
        vectors = StyleVectors.fit(training, classes, form=kind.form)
        return vectors, vectors.assign(every)
    rng = stream(seed, 0, "", "style clusters")
    cells = StyleCells.fit(training, classes, clusters=CLUSTERS, contexts=CONTEXTS, rng=rng)
    if kind.form == "random":
        lots = RandomCells.fit(cells, cells.assign(training), seed=seed)
        return lots, lots.draw(drivers)
    return cells, cells.assign(every)
