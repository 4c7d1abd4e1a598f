"""What a scenario of this backend says under `options`, checked strictly."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from stylesim.errors import InputError, unknown
from stylesim.scenario import Scenario
from stylesim.specs import Spec, parse

PARAMETERS = ("truck_share",)
LIMIT_PARAMETERS = ("speed_limit_mps",)  # of networks that are compiled for each episode
DEMAND_PARAMETERS = ("demand_vph",)
SIGNAL_PARAMETERS = ("cycle_s", "first_green_share", "yellow_s", "all_red_s")
OPTIONAL_PARAMETERS = ("wet_road",)  # 1: drivers decide at a yellow as on a wet road


class NetworkFiles(Spec):
    """Plain XML beside scenario.yaml."""

    nodes: str
    edges: str
    connections: str


class OwnNetwork(Spec):
    """A network of the user's, beside scenario.yaml; what was given is known by its sha256 (`own`)."""

    net: str
    kind: str
    sha256: str
    demand: str = ""  # a route file; without one the flows, or generated ones
    demand_sha256: str = ""


class EdgeType(Spec):
    """A kind of road: its speed limit is the drawn one times `of_limit`, or fixed."""

    of_limit: float | None = Field(default=None, gt=0, le=1.5)
    limit_mps: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _one_of(self) -> EdgeType:
        if (self.of_limit is None) == (self.limit_mps is None):
            raise ValueError("give either of_limit or limit_mps")
        return self


class Flow(Spec):
    """Vehicles that enter by one edge: `share` of the demand, spread over the ways `to`.

    With `onset_tts_s` they come one by one instead: each lane's signal turns yellow when a vehicle of its own is that
    long (drawn between the two numbers, in s) before its stop line, with nobody ahead of it (`dilemma`).
    """

    name: str = Field(pattern=r"^[a-z_]{1,8}$")
    enter: str
    share: float = Field(default=0.0, ge=0, le=1)
    onset_tts_s: tuple[float, float] | None = None
    to: dict[str, float] = Field(min_length=1)  # rest of the route, edges with spaces between (or none) -> weight
    trucks: bool = True

    @model_validator(mode="after")
    def _arrivals(self) -> Flow:
        if (self.onset_tts_s is None) != (self.share > 0):
            raise ValueError("give either share or onset_tts_s")
        if self.onset_tts_s is not None and not 0.0 < self.onset_tts_s[0] <= self.onset_tts_s[1]:
            raise ValueError(f"onset_tts_s must be two rising positive numbers, not {self.onset_tts_s}")
        return self


class SignalPlan(Spec):
    """A fixed-time signal: `groups` of movements get green one after the other.

    A movement is an entering edge, or an edge with SUMO's letters of the directions meant: `west_in:sr`; a group
    without movements is the pedestrians' (everybody has red). The first group gets `first_green_share` of the greens,
    the others share the rest by `weights` (equal ones by default).
    """

    junction: str
    groups: tuple[tuple[str, ...], ...] = Field(min_length=2, max_length=8)
    weights: tuple[float, ...] = ()
    left_turns: Literal["permissive", "protected"] = "permissive"  # of movements without letters
    wave_m: float = 0.0  # the cycle begins later than the episode's by this way at the speed limit (green wave),
    wave_cycles: float = Field(default=0.0, ge=0)  # and by so many cycles: 0.5 is a wave both ways

    @model_validator(mode="after")
    def _weights(self) -> SignalPlan:
        if self.weights and (len(self.weights) != len(self.groups) - 1 or min(self.weights) <= 0):
            raise ValueError(f"weights needs {len(self.groups) - 1} positive numbers, one for each later group")
        return self


class SumoOptions(Spec):
    """The whole of `options`."""

    network: NetworkFiles | None = None
    own: OwnNetwork | None = None
    edge_types: dict[str, EdgeType] = Field(default_factory=dict)
    flows: tuple[Flow, ...] = ()  # of an own network without demand: generated if there are none
    signals: tuple[SignalPlan, ...] = ()
    last_entry_share: float = Field(
        default=1.0, gt=0, le=1
    )  # of the logged time; who came later would be seen too short

    @property
    def has_demand(self) -> bool:
        """Whether any flow is a share of the demand."""
        if self.own is not None and not self.flows:
            return not self.own.demand
        return any(flow.onset_tts_s is None for flow in self.flows)

    @model_validator(mode="after")
    def _shares(self) -> SumoOptions:
        if (self.network is None) == (self.own is None):
            raise ValueError("give either network or own")
        if self.own is None and not self.flows:
            raise ValueError("flows: give at least one")
        total = sum(flow.share for flow in self.flows)
        if self.flows and self.has_demand and abs(total - 1.0) > 1e-6:
            raise ValueError(f"the shares of the flows sum to {total:.6g}, not 1")
        if len({flow.name for flow in self.flows}) != len(self.flows):
            raise ValueError("two flows have the same name")
        if len({plan.junction for plan in self.signals}) != len(self.signals):
            raise ValueError("two signals have the same junction")
        return self


def sumo_options_of(scenario: Scenario) -> SumoOptions:
    """The checked options of a scenario; InputError naming the field, or the parameter that is missing or unknown."""
    where = scenario.folder / "scenario.yaml"
    options = parse(SumoOptions, scenario.options, f"{where}: options")
    wanted = PARAMETERS + (DEMAND_PARAMETERS if options.has_demand else ())
    wanted += LIMIT_PARAMETERS if options.own is None else ()
    wanted += SIGNAL_PARAMETERS if options.signals else ()
    for name in scenario.parameters:
        if name not in wanted + OPTIONAL_PARAMETERS:
            raise unknown("parameter", name, wanted + OPTIONAL_PARAMETERS, where=where)
    for name in wanted:
        if name not in scenario.parameters:
            raise InputError(f"{where}: parameter {name!r} is missing; this scenario needs {', '.join(wanted)}")
    return options


def source_files(scenario: Scenario, options: SumoOptions) -> dict[str, Path]:
    """The network's source files by kind (none of an own network); InputError if one is missing."""
    if options.network is None:
        return {}
    files = {kind: scenario.folder / name for kind, name in options.network.model_dump().items()}
    for kind, path in files.items():
        if not path.is_file():
            raise InputError(f"{scenario.folder / 'scenario.yaml'}: network.{kind}: no such file: {path}")
    return files
