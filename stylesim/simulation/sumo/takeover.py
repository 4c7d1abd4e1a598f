"""Puts a vehicle that somebody else drives where a styled driver was on its way: same lane, place, pace and route."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from stylesim.errors import SimulationError

LENGTH_M, WIDTH_M = 5.0, 1.8  # a passenger car, SUMO's default
PATIENCE_S = 120.0  # chosen, because even a side road of 100 vehicles/h has three entries in that time
ONLY_COMMANDS = 32  # SUMO's speed mode: no safe speed, no limits, no right of way, no red light


@dataclass(frozen=True)
class Place:
    """Where a vehicle is on its way; `position_m` is of the front bumper on its lane."""

    driver_id: str
    lane: str
    position_m: float
    speed_mps: float
    route: tuple[str, ...]  # edges from the present one on
    left_m: float  # of the route


def places(sumo: Any, drivers: Iterable[str]) -> list[Place]:
    """Where each of those drivers is, farthest from its goal first; who is inside a junction is left out."""
    found = []
    for name in drivers:
        edge = sumo.vehicle.getRoadID(name)
        if not edge or edge.startswith(":"):
            continue
        route = tuple(sumo.vehicle.getRoute(name)[sumo.vehicle.getRouteIndex(name) :])
        position = sumo.vehicle.getLanePosition(name)
        left = sum(sumo.lane.getLength(f"{edge}_0") for edge in route) - position
        speed = sumo.vehicle.getSpeed(name)
        found.append(Place(name, sumo.vehicle.getLaneID(name), position, speed, route, left))
    return sorted(found, key=lambda place: (-place.left_m, place.driver_id))


def choose_places(
    sumo: Any,
    drivers: Callable[[], Iterable[str]],
    advance: Callable[[float], None],
    *,
    count: int,
    rng: np.random.Generator,
) -> list[Place]:
    """The places of `count` drivers, drawn from the half that has most of its way ahead.

    While there are too few, the traffic goes on (`advance(until_s)`), for two minutes at most; SimulationError
    where that is not enough.
    """
    begin_s = sumo.simulation.getTime()
    while True:
        found = places(sumo, drivers())
        if len(found) >= count:
            half = max(count, len(found) // 2)
            return [found[i] for i in sorted(rng.choice(half, size=count, replace=False).tolist())]
        now_s = sumo.simulation.getTime()
        if now_s - begin_s >= PATIENCE_S:
            raise SimulationError(f"{len(found)} drivers are on the road, {count} are needed to be taken over")
        advance(now_s + 1.0)


def take_over(sumo: Any, place: Place, name: str) -> None:
    """Replace the driver by a vehicle `name` that does nothing but what it is told; SUMO moves it from its next step.

    The vehicle has a type of its own with the same name.
    """
    sumo.vehicle.remove(place.driver_id)
    put(sumo, place, name)


def put(sumo: Any, place: Place, name: str) -> None:
    """Put a vehicle that obeys commands only onto a place that is free."""
    sumo.vehicletype.copy("DEFAULT_VEHTYPE", name)
    for what, value in (("Length", LENGTH_M), ("Width", WIDTH_M), ("MaxSpeed", 70.0)):
        getattr(sumo.vehicletype, f"set{what}")(name, value)
    sumo.route.add(f"{name}.route", list(place.route))
    lane_index = place.lane.rsplit("_", 1)[1]
    sumo.vehicle.add(name, f"{name}.route", typeID=name, departLane=lane_index, departSpeed="0")
    sumo.vehicle.setSpeedMode(name, ONLY_COMMANDS)
    sumo.vehicle.setLaneChangeMode(name, 0)  # changes lane when told to, never by itself, whoever is there
    sumo.vehicle.moveTo(name, place.lane, place.position_m)
    sumo.vehicle.setPreviousSpeed(name, place.speed_mps)
    sumo.vehicle.setSpeed(name, place.speed_mps)


def onward(sumo: Any, lane: str, route: tuple[str, ...]) -> tuple[str, ...] | None:
    """A way on for a vehicle on that lane, where the lane does not lead to the next edge of its `route`.

    None where it does, at the last edge, and where the lane ends. Straight on is taken before any other link; the
    rest of the way is straight on, too, as far as there are edges.
    """
    edge = lane.rsplit("_", 1)[0]
    links = sumo.lane.getLinks(lane)
    if len(route) < 2 or not links or any(link[0].rsplit("_", 1)[0] == route[1] for link in links):
        return None
    way = [edge]
    while links:
        lane = min(links, key=lambda link: link[6] != "s")[0]
        edge = lane.rsplit("_", 1)[0]
        if edge in way:
            break
        way.append(edge)
        links = sumo.lane.getLinks(lane)
    return tuple(way)
