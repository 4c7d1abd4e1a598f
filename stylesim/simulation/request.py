"""What the bytes of a generated corpus depend on: recorded in it, and compared before it is resumed or replayed."""

from __future__ import annotations

from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from stylesim.corpus.files import sha256_of
from stylesim.planners.loading import planner_source
from stylesim.population import Population
from stylesim.resources import agents_dir
from stylesim.scenario import Scenario
from stylesim.simulation.workers import Job
from stylesim.styles import calibration_file

SIMULATORS = {"sumo": "libsumo", "highway": "highway-env"}  # backend: distribution whose version is recorded
SOURCE = "simulation"


def configuration(job: Job, episodes: int) -> dict[str, Any]:
    """Everything that the bytes depend on, without any path."""
    installed = {}
    for backend in sorted({scenario.backend for scenario in job.scenarios}):
        try:
            installed[SIMULATORS[backend]] = version(SIMULATORS[backend])
        except PackageNotFoundError:
            continue  # the worker says it better when it opens the backend
    return {
        "episodes": episodes,
        "plan": job.plan.model_dump(mode="json"),
        "planner_sha256": _planner(job.plan.ego),
        "twins": None if job.twins is None else job.twins.model_dump(mode="json"),
        "population": _population(job.population),
        "scenarios": [
            {**scenario.model_dump(mode="json", exclude={"folder"}), "files": _files(scenario)}
            for scenario in job.scenarios
        ],
        "simulators": installed,
        "styles_sha256": sha256_of(agents_dir() / "styles.yaml"),
        "calibrations_sha256": {
            backend: sha256_of(path)
            for backend in sorted({scenario.backend for scenario in job.scenarios})
            if (path := calibration_file(backend)) is not None and not job.population.calibration
        },
    }


def _planner(entry_point: str) -> str:
    """sha256 of the planner's module, so that a changed planner is another request; "" without one."""
    source = planner_source(entry_point) if entry_point else None
    return sha256_of(source) if source is not None else ""


def _population(population: Population) -> dict[str, Any]:
    """The population, its calibration file by content."""
    given = population.calibration
    shares = list(population.shares)
    return {**asdict(population), "shares": shares, "calibration": sha256_of(Path(given)) if given else ""}


def _files(scenario: Scenario) -> dict[str, str]:
    """sha256 of each file of the scenario's folder, so that a changed network is another request."""
    paths = sorted(p for p in scenario.folder.iterdir() if p.is_file() and not p.name.startswith("."))
    return {path.name: sha256_of(path) for path in paths}
