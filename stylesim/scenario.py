"""`Scenario`: one scenario family as data, and what is drawn from it for one episode."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from stylesim.errors import unknown
from stylesim.resources import scenarios_dir
from stylesim.specs import Spec, load_yaml


class ScenarioParameter(Spec):
    """A number drawn per episode: from `choices`, or uniformly from [low, high]."""

    unit: str
    source: str = Field(min_length=3)
    low: float | None = None
    high: float | None = None
    choices: tuple[float, ...] = ()

    @model_validator(mode="after")
    def _one_of(self) -> ScenarioParameter:
        ranged = self.low is not None and self.high is not None
        if ranged == bool(self.choices) or (self.low is None) != (self.high is None):
            raise ValueError("give either low and high, or choices")
        if self.low is not None and self.high is not None and self.low > self.high:
            raise ValueError(f"low {self.low} is above high {self.high}")
        return self

    def draw(self, rng: np.random.Generator) -> float:
        """One value."""
        if self.choices:
            return float(self.choices[int(rng.integers(len(self.choices)))])
        assert self.low is not None and self.high is not None
        return float(rng.uniform(self.low, self.high))


class Scenario(Spec):
    """A scenario family. `options` are the backend's own (routes, lanes, files); the backend checks them."""

    name: str
    backend: Literal["sumo", "highway"]
    title: str
    about: str
    duration_s: float = Field(gt=0)  # of an episode's log
    warm_up_s: float = Field(default=0.0, ge=0)  # simulated before it, not logged
    parameters: dict[str, ScenarioParameter] = Field(default_factory=dict)
    options: dict[str, Any] = Field(default_factory=dict)
    folder: Path = Path()

    def draw(self, rng: np.random.Generator) -> dict[str, float]:
        """One value of each parameter, in the order of their names."""
        return {name: self.parameters[name].draw(rng) for name in sorted(self.parameters)}


def scenarios() -> tuple[str, ...]:
    """Names of the shipped scenario families."""
    return tuple(sorted(p.parent.name for p in scenarios_dir().glob("*/scenario.yaml")))


def load_scenario(name: str) -> Scenario:
    """A shipped scenario by name, or the folder (or scenario.yaml) at a path. InputError if there is none."""
    path = Path(name)
    if name in scenarios():  # before folders: one of that name may lie in the working directory
        folder = scenarios_dir() / name
    elif path.name == "scenario.yaml" or path.is_dir():
        folder = path.parent if path.name == "scenario.yaml" else path
    else:
        raise unknown("scenario", name, scenarios())
    scenario = load_yaml(Scenario, folder / "scenario.yaml")
    return scenario.model_copy(update={"folder": folder.resolve()})
