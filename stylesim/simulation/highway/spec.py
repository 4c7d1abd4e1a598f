"""What a scenario of this backend may say in its `options` and must draw in its `parameters`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from stylesim.errors import InputError, unknown
from stylesim.scenario import Scenario
from stylesim.specs import Spec, parse

LOG_HZ = 10  # everything in a corpus is at 0.1 s

Layout = Literal["highway", "intersection", "merge", "exit", "roundabout", "two_way", "yellow_light"]

PARAMETERS: dict[str, tuple[str, ...]] = {
    "highway": ("density_per_km_lane", "lanes", "speed_limit_mps"),
    "intersection": ("initial_vehicles", "spawn_per_s", "speed_limit_mps"),
    "merge": ("density_per_km_lane", "lanes", "ramp_share", "speed_limit_mps"),
    "exit": ("density_per_km_lane", "exit_share", "lanes", "speed_limit_mps"),
    "roundabout": ("demand_vph", "speed_limit_mps"),
    "two_way": ("demand_vph", "speed_limit_mps"),
    "yellow_light": ("demand_vph", "green_s", "red_s", "speed_limit_mps", "yellow_s"),
}
MAY_BE_ZERO = ("spawn_per_s", "ramp_share", "exit_share")


class HighwayOptions(Spec):
    """The `options` of a highway-env scenario."""

    layout: Layout
    simulation_hz: int = Field(default=20, ge=LOG_HZ, le=100, multiple_of=LOG_HZ)
    vehicles: int = Field(default=30, ge=1, le=200)  # of the highway; elsewhere cars come and go
    crashed_stay_s: float = Field(default=5.0, ge=0)  # crashed cars stand that long, then they are removed
    arrivals: Literal["stream", "dilemma"] = "stream"  # at the light: as they come, or placed about the onset of yellow


def options_of(scenario: Scenario) -> HighwayOptions:
    """The checked options; InputError naming the file and the key if an option or a parameter does not fit."""
    where = str(scenario.folder / "scenario.yaml")
    if scenario.backend != "highway":
        raise InputError(f"{where}: scenario {scenario.name!r} is for the backend {scenario.backend!r}, not 'highway'")
    options = parse(HighwayOptions, scenario.options, f"{where}, options")
    known = PARAMETERS[options.layout]
    for name in scenario.parameters:
        if name not in known:
            raise unknown("parameter", name, known, where=where)
    for name in known:
        if name not in scenario.parameters:
            raise InputError(f"{where}: the parameter {name!r} is missing; layout {options.layout!r} draws {known}")
        parameter = scenario.parameters[name]
        least = min(parameter.choices) if parameter.choices else float(parameter.low or 0.0)
        if least <= 0 and not (name in MAY_BE_ZERO and least == 0):
            raise InputError(f"{where}: the parameter {name!r} must be above 0, its least value is {least}")
    return options
