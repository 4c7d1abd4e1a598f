"""`Forecast`, what a forecaster is asked (`ForecastTask`) and what it must be able to do (`Forecaster`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from stylesim.arrays import frozen
from stylesim.scene import Scene


@dataclass(frozen=True, eq=False)
class ForecastTask:
    """One question: where will these agents be?

    `scene` holds history only (made by `Scene.history`): its last frame is t0, it has no commanded style and no
    outcome flags. `agent_index` are the agents to forecast; the answer has `future_steps` steps of `scene.tracks.dt_s`.
    """

    scene: Scene
    agent_index: Int[np.ndarray, " driver"]
    future_steps: int
    t0_frame: int  # frame number of t0 in the scene that this was cut from
    earlier: Scene | None = None  # what was known when the history began, for those who ask for it (`Remembers`)

    def __post_init__(self) -> None:
        """Freeze the index."""
        object.__setattr__(self, "agent_index", frozen(self.agent_index, np.int32, (None,), "agent_index"))


@dataclass(frozen=True, eq=False)
class Forecast:
    """Modes of the future in the scene's frame, and their probabilities (each driver's sum to 1)."""

    mode_m: Float[np.ndarray, "driver mode time 2"]
    probability: Float[np.ndarray, "driver mode"]

    def __post_init__(self) -> None:
        """Check shapes, finiteness and that probabilities sum to 1 within 1e-3."""
        modes = frozen(self.mode_m, np.float32, (None, None, None, 2), "mode_m")
        chance = frozen(self.probability, np.float32, modes.shape[:2], "probability")
        if not (np.isfinite(modes).all() and np.isfinite(chance).all()):
            raise ValueError("a forecast must be finite")
        if len(chance) and (chance.min() < 0 or np.abs(chance.sum(axis=1) - 1).max() > 1e-3):
            raise ValueError("mode probabilities must be >= 0 and sum to 1 for each driver")
        object.__setattr__(self, "mode_m", modes)
        object.__setattr__(self, "probability", chance)


@runtime_checkable
class Forecaster(Protocol):
    """Anything that forecasts. One `Forecast` per task, drivers in the order of `task.agent_index`.

    More may be there: `horizon_s`, how far it can look (everybody is then judged up to the shortest one);
    `covers(task) -> Bool[driver]`, whom it can speak of (see `Covers`); `earlier_s`, how much of the past before the
    history it would like (see `Remembers`).
    """

    name: str

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """Forecast every task."""
        ...


@runtime_checkable
class Covers(Protocol):
    """A forecaster that has no answer for some: predictions from a file, a model for cars alone."""

    def covers(self, task: ForecastTask) -> Bool[np.ndarray, " driver"]:
        """True for the drivers of the task that it can forecast."""
        ...


@runtime_checkable
class Remembers(Protocol):
    """A forecaster that uses what the same scene showed before the history: up to `earlier_s` seconds of it."""

    @property
    def earlier_s(self) -> float:
        """Seconds wanted; 0 for none."""
        ...


@runtime_checkable
class Oracle(Protocol):
    """A forecaster that can be told the truth, for benchmarks; it is only where `sees_future` is True."""

    @property
    def sees_future(self) -> bool:
        """True where it must be told."""
        ...

    def reveal(self, scenes: Iterable[Scene]) -> None:
        """Take the truth of these scenes, whole ones."""
        ...


@runtime_checkable
class Conditioned(Protocol):
    """A forecaster that is told of each driver's style, and can be told otherwise; it is only with some `styles`."""

    @property
    def styles(self) -> tuple[str, ...]:
        """The styles that it knows; () where it is told nothing."""
        ...

    def style_cond(self, task: ForecastTask) -> Any:
        """What it is told of each driver of a task: an array with a row for each."""
        ...

    def contexts(self, task: ForecastTask) -> Int[np.ndarray, " driver"]:
        """The road context of each driver of a task (0 elsewhere, 1 highway)."""
        ...

    def predict_given(self, tasks: Sequence[ForecastTask], cond: Sequence[Any]) -> list[Forecast]:
        """As `predict`, told what `cond` says: rows as `style_cond` gives them, for each task."""
        ...


def is_told(forecaster: object) -> bool:
    """True for a forecaster that is told of each driver's style."""
    return isinstance(forecaster, Conditioned) and bool(forecaster.styles)


def is_untold(forecaster: object) -> bool:
    """True for a forecaster that says (`styles` is empty) that it is one that could be told, but is told nothing.

    It is what a gain from styles is measured against: a baseline without learning has no `styles` at all.
    """
    return getattr(forecaster, "styles", None) == ()


def horizon_s(forecaster: Forecaster) -> float:
    """How far the forecaster can look, in seconds; infinity where it does not say."""
    return float(getattr(forecaster, "horizon_s", math.inf))


def earlier_s(forecasters: Sequence[object]) -> float:
    """The longest past before the history that one of the forecasters would like, in seconds."""
    return max((f.earlier_s for f in forecasters if isinstance(f, Remembers)), default=0.0)


def covered(forecasters: Sequence[Forecaster], task: ForecastTask) -> Bool[np.ndarray, " driver"]:
    """The drivers of a task that every one of the forecasters can speak of."""
    result = np.ones(len(task.agent_index), bool)
    for forecaster in forecasters:
        if isinstance(forecaster, Covers):
            result &= forecaster.covers(task)
    return result
