"""Every scenario of the catalogue as an environment: `scenario_env("ramp_merge")`, id `stylesim/RampMerge-v0`."""

from __future__ import annotations

from typing import Any, ClassVar

from stylesim.envs.base import DrivingEnv
from stylesim.envs.config import EnvConfig
from stylesim.envs.crowd import place_of
from stylesim.envs.world import World
from stylesim.errors import unknown


class SumoEnv(DrivingEnv):
    """A scenario in SUMO: the ego takes over a driver on its way. The simulation runs in a child process of its own."""

    backend: ClassVar[str] = "sumo"
    default_scenario: ClassVar[str] = "ramp_merge"
    defaults: ClassVar[dict[str, Any]] = {"period_s": 0.1, "max_speed_mps": 40.0}

    def _make_world(self) -> World:
        return open_world(self.backend, self.config)


class HighwayScenarioEnv(DrivingEnv):
    """A scenario in highway-env: the ego takes over a driver on its way; decisions once a second."""

    backend: ClassVar[str] = "highway"
    default_scenario: ClassVar[str] = "intersection"
    defaults: ClassVar[dict[str, Any]] = {"period_s": 1.0, "duration_s": 40.0, "max_speed_mps": 40.0}

    def _make_world(self) -> World:
        return open_world(self.backend, self.config)


KINDS: dict[str, type[DrivingEnv]] = {"sumo": SumoEnv, "highway": HighwayScenarioEnv}


def scenario_env(scenario: Any, **arguments: Any) -> DrivingEnv:
    """The environment of a scenario (name, folder or `Scenario`), whatever its simulator.

    `arguments` are those of `DrivingEnv`. InputError for names and values that do not fit.
    """
    place = place_of(scenario)
    if place.backend not in KINDS:
        raise unknown("backend", place.backend, KINDS)
    return KINDS[place.backend](scenario=place, **arguments)


def open_world(backend: str, config: EnvConfig, *, egos: int = 1) -> World:
    """The simulation behind an environment; no simulator is loaded before its first reset."""
    if backend == "sumo":
        from stylesim.envs.sumo_client import SumoWorld

        return SumoWorld(config, egos=egos)
    from stylesim.envs.highway_world import HighwayWorld

    return HighwayWorld(config, egos=egos)
