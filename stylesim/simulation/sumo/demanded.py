"""The demand of a user's route file: its vehicles, trips and flows, with styled drivers in them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.simulation.sumo.demand import Arrivals
from stylesim.simulation.sumo.roads import RoadNetwork
from stylesim.simulation.sumo.vehicles import Driver, draw_body
from stylesim.simulation.sumo.ways import WayFinder
from stylesim.tracks import AgentKind
from stylesim.xmlfiles import parse

ID = re.compile(r"[\w.\-:#/]{1,64}")
TRUCKS = ("truck", "trailer", "delivery")
READ = ("vehicle", "trip", "flow", "route", "vType", "vTypeDistribution", "routeDistribution")
MOST_VEHICLES = 200_000  # chosen, because an episode of more would not fit into memory


@dataclass(frozen=True)
class Entered:
    """One vehicle of the file, its flow's number included. `whole`: its edges are the way, else only its ends."""

    name: str
    depart_s: float
    edges: tuple[str, ...]
    whole: bool
    via: tuple[str, ...]
    type_id: str


@dataclass(frozen=True)
class RouteFile:
    """What a route file says of cars and trucks. Times count from its first departure."""

    entries: tuple[Element, ...]
    routes: dict[str, tuple[str, ...]]
    types: dict[str, dict[str, str]]
    begin_s: float
    ignored: dict[str, int]  # elements that are no traffic of cars, by name


@lru_cache(maxsize=8)
def read_route_file(path: Path) -> RouteFile:
    """The file's vehicles, trips, flows, routes and types; InputError that names the file and the element."""
    root = parse(path, root="routes")
    routes = {e.get("id", ""): tuple(e.get("edges", "").split()) for e in root.iter("route") if e.get("id")}
    types = {e.get("id", ""): dict(e.attrib) for e in root.iter("vType")}
    entries = [e for e in root if e.tag in ("vehicle", "trip", "flow")]
    ignored: dict[str, int] = {}
    for element in root:
        if element.tag not in READ:
            ignored[element.tag] = ignored.get(element.tag, 0) + 1
    if not entries:
        raise InputError(f"{path}: no vehicle, trip or flow is in it")
    begins = [
        _number(path, e, "begin" if e.tag == "flow" else "depart", 0.0 if e.tag == "flow" else None) for e in entries
    ]
    return RouteFile(tuple(entries), routes, types, min(begins), ignored)


def _number(path: Path, element: Element, name: str, default: float | None = None) -> float:
    """A time or number of an element, as seconds or h:m:s; InputError where it is none, or missing without default."""
    where = f"{path}: <{element.tag} id={element.get('id', '')[:64]!r}>"
    text = element.get(name)
    if text is None:
        if default is None:
            raise InputError(f"{where} has no {name!r}")
        return default
    parts = text.split(":")
    try:
        value = float(text) if len(parts) == 1 else sum(float(p) * 60**i for i, p in enumerate(reversed(parts)))
    except ValueError:
        value = float("nan")
    if not (np.isfinite(value) and value >= 0.0):
        raise InputError(f"{where}: {name}={text[:64]!r} is no number of seconds; only numbers are understood")
    return value


def _departures(path: Path, flow: Element, arrivals: Arrivals, begin_s: float) -> Iterator[float]:
    """The times of a flow within the episode: by `number`, `period` (or exp(rate)), `vehsPerHour` or `probability`."""
    begin = _number(path, flow, "begin", 0.0) - begin_s
    end = min(_number(path, flow, "end", 86_400.0) - begin_s, arrivals.until_s)
    rng = stream(arrivals.seed, arrivals.episode, flow.get("id", ""), "departures")
    given = [name for name in ("number", "period", "vehsPerHour", "probability") if flow.get(name) is not None]
    exponential = re.fullmatch(r"exp\(([0-9.eE+-]+)\)", flow.get("period", ""))
    if exponential:
        time = begin + float(rng.exponential(1.0 / float(exponential[1])))
        while time < end:
            yield time
            time += float(rng.exponential(1.0 / float(exponential[1])))
        return
    if not given:
        raise InputError(f"{path}: <flow id={flow.get('id')!r}> needs number, period, vehsPerHour or probability")
    if given == ["probability"]:
        hits = rng.random(max(0, int(end - begin))) < _number(path, flow, "probability")
        yield from (begin + float(second) for second in np.flatnonzero(hits))
        return
    if "vehsPerHour" in given:
        period = 3600.0 / max(_number(path, flow, "vehsPerHour"), 1e-6)
    elif "period" in given:
        period = _number(path, flow, "period")
    else:
        whole = _number(path, flow, "end", 86_400.0) - _number(path, flow, "begin", 0.0)
        period = whole / max(_number(path, flow, "number"), 1e-6)
    number = int(_number(path, flow, "number", float(MOST_VEHICLES)))
    for index in range(number):
        time = begin + index * max(period, 0.1)
        if time >= end:
            return
        yield time


def _entered(path: Path, file: RouteFile, arrivals: Arrivals) -> Iterator[Entered]:
    for element in file.entries:
        name = element.get("id", "")
        if not ID.fullmatch(name):
            raise InputError(
                f"{path}: <{element.tag}> with the id {name[:64]!r}; ids are 1 to 64 of A-z 0-9 _ . - : # /"
            )
        edges, whole = _edges(path, file, element)
        via = tuple(element.get("via", "").split())
        kind = element.get("type", "DEFAULT_VEHTYPE")
        if element.tag == "flow":
            for number, time in enumerate(_departures(path, element, arrivals, file.begin_s)):
                yield Entered(f"{name}.{number}", time, edges, whole, via, kind)
        else:
            yield Entered(name, _number(path, element, "depart") - file.begin_s, edges, whole, via, kind)


def _edges(path: Path, file: RouteFile, element: Element) -> tuple[tuple[str, ...], bool]:
    """The edges of its route (the whole way), or the two of `from` and `to`."""
    inline = element.find("route")
    if inline is not None:
        return _some(path, element, tuple(inline.get("edges", "").split())), True
    if element.get("route") is not None:
        named = file.routes.get(element.get("route", ""))
        if named is None:
            raise InputError(f"{path}: <{element.tag} id={element.get('id')!r}>: no route {element.get('route')!r}")
        return _some(path, element, named), True
    if element.get("from") and element.get("to"):
        return (element.get("from", ""), element.get("to", "")), False
    raise InputError(f"{path}: <{element.tag} id={element.get('id')!r}> has neither a route nor from and to")


def _some(path: Path, element: Element, edges: tuple[str, ...]) -> tuple[str, ...]:
    if not edges:
        raise InputError(f"{path}: <{element.tag} id={element.get('id')!r}> has a route without edges")
    return edges


def demanded_drivers(
    path: Path, network: RoadNetwork, population: Population, arrivals: Arrivals
) -> tuple[Driver, ...]:
    """A styled driver for each vehicle that the file lets depart within the episode.

    Kind and size come from the vehicle's type in the file where it says them. InputError for an edge that the network
    does not have, and a trip that has no way.
    """
    file, finder = read_route_file(path), WayFinder(network)
    searched: dict[str, dict[str, str]] = {}
    drivers: list[Driver] = []
    for entered in _entered(path, file, arrivals):
        if not 0.0 <= entered.depart_s < arrivals.until_s:
            continue
        edges = _way(path, entered, finder, searched)
        drivers.append(_driver(entered, edges, file.types.get(entered.type_id, {}), population, arrivals))
        if len(drivers) > MOST_VEHICLES:
            raise InputError(f"{path}: more than {MOST_VEHICLES} vehicles depart in an episode; make it shorter")
    names = {driver.driver_id for driver in drivers}
    if len(names) < len(drivers):
        raise InputError(f"{path}: two vehicles have the same id")
    return tuple(drivers)


def _way(path: Path, entered: Entered, finder: WayFinder, searched: dict[str, dict[str, str]]) -> tuple[str, ...]:
    """The whole way: as given, or by the shortest way between the edges that are named."""
    way: list[str] = []
    for goal in entered.edges if entered.whole else (entered.edges[0], *entered.via, *entered.edges[1:]):
        if not finder.lanes.get(goal):
            raise InputError(
                f"{path}: vehicle {entered.name!r} uses edge {goal!r}, which has no lane for cars in this network"
            )
        if not way or entered.whole:
            way.append(goal)
            continue
        before = searched.setdefault(way[-1], finder.shortest(way[-1]))
        if goal not in before:
            raise InputError(f"{path}: vehicle {entered.name!r}: no way leads from edge {way[-1]!r} to {goal!r}")
        way += finder.way(before, goal)[1:]
    return tuple(way)


def _driver(
    entered: Entered, edges: tuple[str, ...], kind: dict[str, str], population: Population, arrivals: Arrivals
) -> Driver:
    truck = kind.get("vClass", "passenger") in TRUCKS
    body = stream(arrivals.seed, arrivals.episode, entered.name, "body")
    what, length, width = draw_body(truck=truck, rng=body)
    style = population.draw(
        stream(arrivals.seed, arrivals.episode, entered.name, "style"),
        backend="sumo",
        limit_mps=arrivals.limits_mps.get(edges[0]),
    )
    return Driver(
        entered.name,
        style,
        AgentKind.TRUCK if truck else what,
        _size(kind.get("length"), length),
        _size(kind.get("width"), width),
        round(entered.depart_s, 1),
        " ".join(edges),
    )


def _size(text: str | None, drawn: float) -> float:
    """A length in m from the file, where it is one of a vehicle."""
    try:
        value = float(text) if text is not None else drawn
    except ValueError:
        return drawn
    return value if 0.5 <= value <= 20.0 else drawn
