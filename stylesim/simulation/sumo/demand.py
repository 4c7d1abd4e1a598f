"""Who enters an episode, when, and where to; and the route file that says so to SUMO."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from stylesim.errors import SimulationError
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.simulation.sumo.options import Flow, SumoOptions
from stylesim.simulation.sumo.roads import RoadNetwork
from stylesim.simulation.sumo.signals import ONSET_S
from stylesim.simulation.sumo.vehicles import TRUCK_TOP_SPEED_MPS, Driver, draw_body, type_attributes
from stylesim.style import DriverStyle

STYLES_OF_SLOW_TRUCKS = ("careful", "cautious")
MOST_TRUCKS = 0.5  # of the drivers of those styles; chosen, because a population of few of them has cars, too
SHORTEST_HEADWAY_S = 0.5  # between entries of one flow; chosen, because two lanes at 1 s each can be entered that fast
ROUTES_HEAD = (
    '<routes xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
    ' xsi:noNamespaceSchemaLocation="http://sumo.dlr.de/xsd/routes_file.xsd">'
)  # names the schema, because without it SUMO ignores a misspelt attribute


@dataclass(frozen=True)
class Arrivals:
    """The key of an episode's random streams and its demand."""

    seed: int
    episode: int
    until_s: float
    parameters: Mapping[str, float]
    limits_mps: Mapping[str, float] = field(default_factory=dict)  # of the edges, where no limit is drawn


def _departures(flow: Flow, arrivals: Arrivals) -> Iterator[float]:
    """Times in s, rounded to the step: Poisson arrivals with a shortest headway (shifted exponential)."""
    mean = 3600.0 / (arrivals.parameters["demand_vph"] * flow.share)
    shortest = min(SHORTEST_HEADWAY_S, 0.5 * mean)
    rng = stream(arrivals.seed, arrivals.episode, flow.name, "departures")
    time = float(rng.exponential(mean))
    while time < arrivals.until_s:
        yield round(time, 1)
        time += shortest + float(rng.exponential(mean - shortest))


def truck_chance(style: DriverStyle, population: Population, *, share: float, limit_mps: float | None) -> float:
    """The chance that this driver has a truck, so that `share` of all drivers do.

    On a road that is faster than a truck's limiter only careful and cautious drivers have one, at most one in two of
    them: whoever is bound to 25 m/s there is slower than the traffic, and drives as one of these whatever it wishes.
    """
    if population.within_class == "neutral" or limit_mps is None or limit_mps <= TRUCK_TOP_SPEED_MPS:
        return share
    if style.name not in STYLES_OF_SLOW_TRUCKS:
        return 0.0
    slow = sum(population.by_class[name] for name in STYLES_OF_SLOW_TRUCKS)
    return min(MOST_TRUCKS, share / slow)


def drawn_driver(flow: Flow, number: int, depart_s: float, population: Population, arrivals: Arrivals) -> Driver:
    """One driver; each of its draws has a stream of its own, so that another driver shifts none."""
    name = f"{flow.name}.{number}"
    ways = list(flow.to)
    weight = np.array([flow.to[way] for way in ways])
    seed, episode = arrivals.seed, arrivals.episode
    way = ways[int(stream(seed, episode, name, "route").choice(len(ways), p=weight / weight.sum()))]
    limit = arrivals.parameters.get("speed_limit_mps", arrivals.limits_mps.get(flow.enter))
    style = population.draw(stream(seed, episode, name, "style"), backend="sumo", limit_mps=limit)
    body = stream(seed, episode, name, "body")
    chance = truck_chance(style, population, share=arrivals.parameters["truck_share"], limit_mps=limit)
    kind, length, width = draw_body(truck=bool(body.random() < chance) and flow.trucks, rng=body)
    return Driver(name, style, kind, length, width, depart_s, f"{flow.enter} {way}".strip())


def draw_drivers(options: SumoOptions, population: Population, arrivals: Arrivals) -> tuple[Driver, ...]:
    """Every driver who comes as a share of the demand, by time of entry."""
    drivers = [
        drawn_driver(flow, number, time, population, arrivals)
        for flow in options.flows
        if flow.onset_tts_s is None
        for number, time in enumerate(_departures(flow, arrivals))
    ]
    return tuple(sorted(drivers, key=lambda driver: (driver.depart_s, driver.driver_id)))


def check_routes(options: SumoOptions, network: RoadNetwork, *, name: str) -> None:
    """SimulationError if a flow names an edge that the network does not have."""
    for flow in options.flows:
        for edge in [flow.enter, *(edge for way in flow.to for edge in way.split())]:
            if edge not in network.edges:
                raise SimulationError(
                    f"scenario {name!r}: flow {flow.name!r} uses edge {edge!r}; known: {', '.join(network.edges)}"
                )


def _entry_xml(driver: Driver) -> str:
    entry = driver.entry
    if entry is None:
        return 'departLane="best" departSpeed="max" departPos="base"'
    return f'departLane="{entry.lane}" departSpeed="{entry.speed_mps:.3f}" departPos="{entry.position_m:.3f}"'


def type_xml(driver: Driver, *, pedal_by_sumo: bool = True) -> str:
    """The driver's vehicle type."""
    told = type_attributes(driver, pedal_by_sumo=pedal_by_sumo) | {"jmDriveAfterYellowTime": f"{ONSET_S:.2f}"}
    attributes = " ".join(f'{key}="{value}"' for key, value in told.items())
    return f'<vType id="{driver.type_id}" {attributes}/>'


def routes_xml(drivers: tuple[Driver, ...], others: tuple[Driver, ...] = ()) -> str:
    """The route file: a vehicle type and a vehicle for each driver, and types for who `others` will become.

    Their pedals are left to `simulation.foot`.
    """
    lines = [ROUTES_HEAD, *(type_xml(driver, pedal_by_sumo=False) for driver in others)]
    for driver in drivers:
        lines.append(type_xml(driver, pedal_by_sumo=False))
        lines.append(
            f'<vehicle id="{driver.driver_id}" type="{driver.driver_id}" depart="{driver.depart_s:.1f}"'
            f' {_entry_xml(driver)}><route edges="{driver.route}"/></vehicle>'
        )
    return "\n".join([*lines, "</routes>", ""])
