"""`Backend`: what a simulator must offer, and how one is opened by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from stylesim.errors import unknown
from stylesim.population import Population
from stylesim.scenario import Scenario
from stylesim.scene import Scene
from stylesim.simulation.plan import PLAIN, EpisodePlan


@runtime_checkable
class Backend(Protocol):
    """One simulator. It runs one episode at a time; the same arguments give the same scene, bit for bit."""

    @property
    def name(self) -> str:
        """The backend's name as in `Scenario.backend`."""
        ...

    def run_episode(
        self, scenario: Scenario, population: Population, *, seed: int, episode: int, plan: EpisodePlan = PLAIN
    ) -> Scene:
        """One episode from its first to its last frame, with what `plan` adds to it.

        Every random number comes from `stylesim.randomness.stream(seed, episode, driver, purpose)`.
        Raises InputError for a scenario that does not fit, SimulationError where the simulator refuses it.
        """
        ...

    def close(self) -> None:
        """End what is running; the backend may be used again afterwards."""
        ...


def _sumo() -> Backend:
    from stylesim.simulation.sumo import SumoBackend

    return SumoBackend()


def _highway() -> Backend:
    from stylesim.simulation.highway import HighwayBackend

    return HighwayBackend()


BACKENDS: dict[str, Callable[[], Backend]] = {"sumo": _sumo, "highway": _highway}


def open_backend(name: str) -> Backend:
    """The backend of that name; its simulator is imported here and not before.

    Raises InputError for an unknown name, MissingDependencyError where the simulator cannot be imported.
    """
    if name not in BACKENDS:
        raise unknown("backend", name, BACKENDS)
    return BACKENDS[name]()
