"""The scenarios and densities of a calibration, and what is held out of it."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from stylesim.errors import InputError, unknown
from stylesim.evaluation.fidelity_targets import HELD_TO_TARGET
from stylesim.scenario import Scenario, load_scenario
from stylesim.simulation.backend import BACKENDS
from stylesim.styles import Calibration, road_kind

DENSITY = ("demand_vph", "density_per_km_lane", "demand_vph_lane")  # the parameter that is a density, by scenario
HELD_OUT = {"sumo": "lane_drop", "highway": "hw_exit"}  # by default
DENSER = 1.25  # the held-out density: from the highest calibrated one to a quarter more; chosen


class Regimes:
    """Scenario folders to calibrate on; copies with the held-out density; a place for trial files."""

    def __init__(self, scenarios: Sequence[Scenario], held_out: Scenario | None) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="stylesim-regimes-")
        self.names = tuple(scenario.name for scenario in scenarios)
        self.folders = tuple(str(scenario.folder) for scenario in scenarios)
        self.held_out_name = held_out.name if held_out is not None else ""
        self.held_out_folder = str(held_out.folder) if held_out is not None else ""
        self.densities: dict[str, tuple[float, float]] = {}
        self.high_densities: dict[str, tuple[float, float]] = {}
        self.dense_folders = tuple(f for f in map(self._denser, scenarios) if f)
        self.roads = tuple(sorted({_road(scenario) for scenario in scenarios}))
        self._trials = 0

    def _denser(self, scenario: Scenario) -> str:
        """A copy of the scenario's folder with the held-out density; "" where it has no density."""
        name = next((n for n in DENSITY if n in scenario.parameters), "")
        if not name:
            return ""
        parameter = scenario.parameters[name]
        low = parameter.low if parameter.low is not None else min(parameter.choices)
        high = parameter.high if parameter.high is not None else max(parameter.choices)
        self.densities[scenario.name] = (low, high)
        self.high_densities[scenario.name] = (high, DENSER * high)
        folder = Path(self._folder.name) / scenario.name
        shutil.copytree(scenario.folder, folder)
        raw: dict[str, Any] = yaml.safe_load((folder / "scenario.yaml").read_text(encoding="utf-8"))
        kept = {k: raw["parameters"][name][k] for k in ("unit", "source")}
        raw["parameters"][name] = {**kept, "low": high, "high": DENSER * high}
        (folder / "scenario.yaml").write_text(yaml.safe_dump(raw, sort_keys=False), encoding="utf-8")
        return str(folder)

    @contextmanager
    def written(self, backend: str, roads: dict[str, Any]) -> Iterator[Path]:
        """A calibration file for one trial; under a name of its own, because files are remembered by name."""
        self._trials += 1
        path = Path(self._folder.name) / f"trial-{self._trials:03d}.yaml"
        document = Calibration.model_validate({"about": "a trial", "backend": backend, "roads": roads})
        path.write_text(yaml.safe_dump(document.model_dump(mode="json"), sort_keys=False), encoding="utf-8")
        yield path

    def close(self) -> None:
        """Remove the copies."""
        self._folder.cleanup()


def _road(scenario: Scenario) -> str:
    """The one kind of road of a scenario. InputError if its limits are of both kinds, or it has none."""
    limit = scenario.parameters.get("speed_limit_mps")
    if limit is None:
        raise InputError(f"scenario {scenario.name!r} has no parameter speed_limit_mps; its roads cannot be told apart")
    ends = limit.choices or (limit.low, limit.high)
    kinds = {road_kind(value) for value in ends}
    if len(kinds) > 1:
        raise InputError(f"scenario {scenario.name!r}: its limits belong to both kinds of road; calibrate them apart")
    return kinds.pop()


def chosen_regimes(backend: str, scenarios: Sequence[str], held_out: str) -> Regimes:
    """The scenarios by name or folder. InputError for an unknown backend or scenario, or one of another backend."""
    if backend not in BACKENDS:
        raise unknown("backend", backend, BACKENDS)
    apart = held_out or HELD_OUT[backend]
    names = list(scenarios)
    if not names:
        shipped = [load_scenario(name) for name in HELD_TO_TARGET]
        names = [s.name for s in shipped if s.backend == backend and s.name != apart]
    if held_out and held_out in names:
        raise InputError(f"{held_out!r} cannot be calibrated on and held out; name it once")
    loaded = [load_scenario(name) for name in names]
    out = None if scenarios and not held_out else load_scenario(apart)
    for scenario in [*loaded, *([out] if out is not None else [])]:
        if scenario.backend != backend:
            raise InputError(f"scenario {scenario.name!r} runs in {scenario.backend!r}, not in {backend!r}")
    return Regimes(loaded, out)
