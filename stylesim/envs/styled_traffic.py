"""`StyledTraffic`: the traffic of any highway-env environment, theirs or a user's own, driven by styled drivers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np

from stylesim.envs.crowd import resolved_population
from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.simulation.highway.adoption import become_styled
from stylesim.simulation.highway.traffic import Crew

MAX_SEED = 2**31 - 1


class StyledTraffic(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Every car of a highway-env environment that drives by itself gets a driver of the population, newcomers too.

    `population` (name, path or `Population`) or `styles` (shares that sum to 1) choose the crowd. The environment's own
    road, vehicles, observation, action, reward and end stay; the cars' behaviour is that of the `highway` backend.
    `info["drivers"]` names who is on the road: id, style and aggressiveness, in the order of the road's vehicles.
    `seed` fixes the crowd apart from the environment; without it, it follows from the seed of `reset`. InputError for
    an environment that is not highway-env's, and for names and shares that do not fit.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        *,
        population: str | Population | None = None,
        styles: str | Mapping[str, float] | None = None,
        seed: int | None = None,
    ) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, population=population, styles=styles, seed=seed)
        super().__init__(env)
        if not hasattr(env.unwrapped, "controlled_vehicles"):
            raise InputError(f"StyledTraffic wraps environments of highway-env; {env.unwrapped!r} has no vehicles")
        self._population = resolved_population(population, styles)
        self._seed = seed
        self._seeds = np.random.default_rng(seed)
        self._crew: Crew | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """A new episode with a new crowd; the same seed gives the same crowd."""
        observation, info = self.env.reset(seed=seed, options=options)
        if seed is not None and self._seed is None:
            self._seeds = np.random.default_rng(seed)
        self._crew = Crew(self._population, seed=int(self._seeds.integers(MAX_SEED)), episode=0)
        self._hire()
        return observation, info | {"drivers": self.drivers()}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """One decision of the environment; who has come in it gets a driver."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._hire()
        return observation, reward, terminated, truncated, info | {"drivers": self.drivers()}

    def _hire(self) -> None:
        inner: Any = self.env.unwrapped
        if self._crew is not None and inner.road is not None:
            become_styled(inner.road, keep=inner.controlled_vehicles, crew=self._crew)

    def drivers(self) -> dict[str, tuple[Any, ...]]:
        """Who is on the road now: `id`, `style` and `aggressiveness` of every styled driver."""
        inner: Any = self.env.unwrapped
        styled = [car for car in inner.road.vehicles if getattr(car, "style", None) is not None]
        return {
            "id": tuple(car.driver_id for car in styled),
            "style": tuple(car.style.name for car in styled),
            "aggressiveness": tuple(float(car.style.aggressiveness) for car in styled),
        }
