"""highway-env's roads with the searches that cost the time done once per step instead of once per question."""

from __future__ import annotations

import math
from bisect import bisect_left
from typing import Any

import numpy as np
from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import Road
from highway_env.vehicle.objects import Landmark
from jaxtyping import Bool

from stylesim.simulation.highway.flow_sense import LOOKS_EVERY_S, look_around
from stylesim.simulation.highway.graph import LaneGraph, LaneIndex
from stylesim.simulation.highway.path import ALIGNED_RAD, LANES_AHEAD, STANDING_MPS
from stylesim.simulation.highway.projection import Projection
from stylesim.simulation.highway.quick import quicken

LOOK_AHEAD_M = 200.0  # chosen: beyond it a leader changes the IDM's acceleration by less than 0.1 m/s2
LOOK_BACK_M = 100.0  # chosen, as for leaders in REFERENCE section 1
MEETS_S = 2.5  # chosen: who comes on one's own lane is braked for when it is nearer than that
MEETS_PASSING_S = 1.0  # and by who overtakes, because it means to be back by then
NOBODY = (None, math.inf)


class StyledRoad(Road):  # type: ignore[misc]
    """Neighbours from a list per lane, closest lanes for all cars at once, collisions checked for near pairs only.

    A car is a neighbour on a lane if it reaches into it, or is changing onto it. highway-env takes every centre
    within a metre of the lane instead, so that a car which wanders in the next lane would be braked for.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.prepare()

    def prepare(self) -> None:
        """Work out what depends on the network only; called once, also for a road that became one of this class."""
        quicken(self.network)
        self.collided_pairs: set[frozenset[str]] = set()
        self.graph = LaneGraph(self.network)
        self._projection = Projection(self.network)
        self._projected = np.zeros((0, 3))
        self._column: dict[int, int] = {}
        self._cars: list[Any] | None = None
        self._on_lane: dict[Any, tuple[list[float], list[Any]]] = {}
        self._reaching: list[list[bool]] | None = None
        self._since_look_s = 0.0
        self._moving = False  # inside act and step, where nobody else moves anybody
        self.in_step = False  # cars leave their closest lane to the road then

    def act(self) -> None:
        """Let everybody decide."""
        self._refresh()
        self._on_lane = {}
        if self._since_look_s >= LOOKS_EVERY_S - 1e-9:
            self._since_look_s = 0.0
            look_around(self.vehicles)
        self._moving = True
        super().act()
        self._moving = False

    def step(self, dt: float) -> None:
        """Move every car, find its closest lane, then let the pairs that could touch check for a collision."""
        self._since_look_s += dt
        self.in_step = True
        for vehicle in self.vehicles:
            vehicle.step(dt)
        self.in_step = False
        self._refresh()
        lanes = self._projection
        for vehicle, number in zip(self.vehicles, lanes.closest(), strict=False):
            if getattr(vehicle, "lane_from_road", False):
                vehicle.lane_index, vehicle.lane = lanes.index[number], lanes.lane[number]
                if self.record_history:
                    vehicle.history.appendleft(vehicle.create_from(vehicle))
        if len(self.vehicles) > 1:
            for i, j in np.argwhere(self._may_touch(dt)):
                self.vehicles[i].handle_collisions(self.vehicles[j], dt)
        for vehicle in self.vehicles:
            for other in self.objects:
                vehicle.handle_collisions(other, dt)

    def _may_touch(self, dt: float) -> Bool[np.ndarray, "car car"]:
        """Pairs whose boxes, enlarged by what they move within dt, overlap in x and in y; each pair once."""
        state = np.array([[*v.position, v.heading, v.speed, v.LENGTH, v.WIDTH] for v in self.vehicles])
        cos, sin = np.abs(np.cos(state[:, 2])), np.abs(np.sin(state[:, 2]))
        moved = np.abs(state[:, 3]) * dt
        half_x = (state[:, 4] * cos + state[:, 5] * sin) / 2 + moved * cos
        half_y = (state[:, 4] * sin + state[:, 5] * cos) / 2 + moved * sin
        x, y = state[:, 0], state[:, 1]
        near = np.abs(x[:, None] - x) <= half_x[:, None] + half_x
        near &= np.abs(y[:, None] - y) <= half_y[:, None] + half_y
        return np.triu(near, k=1)

    def _refresh(self) -> None:
        """Project everybody, unless nobody came, went or moved since."""
        cars = [*self.vehicles, *(thing for thing in self.objects if not isinstance(thing, Landmark))]
        state = np.array([[car.position[0], car.position[1], car.heading] for car in cars]).reshape(-1, 3)
        known = self._cars
        same = known is not None and len(known) == len(cars) and all(a is b for a, b in zip(cars, known, strict=True))
        if same and np.array_equal(state, self._projected):
            return
        self._cars, self._projected = cars, state
        self._column = {id(car): number for number, car in enumerate(cars)}
        self._projection.update(cars)
        self._on_lane, self._reaching = {}, None

    def place(self, vehicle: Any, lane_index: LaneIndex) -> tuple[float, float]:
        """(along, to the right of the centre) of a car on a lane, m; from the projection where that is of this step."""
        column = self._column.get(id(vehicle)) if self._moving else None
        if column is None:
            return self.network.get_lane(lane_index).local_coordinates(vehicle.position)
        number = self._projection.number[lane_index]
        return self._projection.along_m[number][column], self._projection.aside_m[number][column]

    def neighbour_vehicles(self, vehicle: Any, lane_index: Any = None) -> tuple[Any, Any]:
        """The cars in front of and behind `vehicle` on that lane, also beyond its ends."""
        routed = bool(getattr(vehicle, "route", None))
        if lane_index is None or routed:  # where paths part, the nearest lane may be one that it does not follow
            lane_index = vehicle.target_lane_index if routed else vehicle.lane_index
        return self.ahead(vehicle, lane_index)[0], self.behind(vehicle, lane_index)[0]

    def ahead(self, vehicle: Any, lane_index: LaneIndex) -> tuple[Any, float]:
        """(who is in front of `vehicle` on that lane and those after it on its way, gap bumper to bumper in m).

        On the lanes after it only who goes along or stands counts: who crosses is the right of way's business.
        """
        if not self._moving:
            self._refresh()
        here = self.place(vehicle, lane_index)[0]
        places, cars = self._occupants(lane_index)
        for number in range(bisect_left(places, here), len(cars)):
            gap = places[number] - here - (cars[number].LENGTH + vehicle.LENGTH) / 2
            if cars[number] is not vehicle and not self._comes_later(vehicle, lane_index, cars[number], gap):
                return cars[number], gap
        lanes, index = self._projection, lane_index
        start = lanes.length_m[lanes.number[index]] - here
        for _ in range(LANES_AHEAD):
            onward = self.graph.onward(index, getattr(vehicle, "route", None)) if start <= LOOK_AHEAD_M else None
            if onward is None:
                break
            index = onward
            found = self._first_beyond(vehicle, index, -start)
            if found is not None:
                return found[0], start + found[1] - (found[0].LENGTH + vehicle.LENGTH) / 2
            start += lanes.length_m[lanes.number[index]]
        return NOBODY

    def _first_beyond(self, vehicle: Any, index: LaneIndex, least_m: float) -> tuple[Any, float] | None:
        lane = self._projection.number[index]
        for along, car in zip(*self._occupants(index), strict=True):
            if along <= least_m or car is vehicle:
                continue
            if car.speed < STANDING_MPS or self._projection.aligned(lane, self._column[id(car)], ALIGNED_RAD):
                return car, along
        return None

    def behind(self, vehicle: Any, lane_index: LaneIndex) -> tuple[Any, float]:
        """(who is behind `vehicle` on that lane and those before it, gap bumper to bumper in m)."""
        if not self._moving:
            self._refresh()
        here = self.place(vehicle, lane_index)[0]
        places, cars = self._occupants(lane_index)
        for number in range(bisect_left(places, here) - 1, -1, -1):
            if cars[number] is not vehicle and not self._comes(lane_index, cars[number]):
                return cars[number], here - places[number] - (cars[number].LENGTH + vehicle.LENGTH) / 2
        nearest: tuple[Any, float] = NOBODY
        for index in self.graph.before[lane_index] if here <= LOOK_BACK_M else ():
            length = self._projection.length_m[self._projection.number[index]]
            places, cars = self._occupants(index)
            for number in range(len(cars) - 1, -1, -1):
                gap = here + length - places[number] - (cars[number].LENGTH + vehicle.LENGTH) / 2
                if cars[number] is not vehicle and places[number] <= length + here:
                    nearest = min(nearest, (cars[number], gap), key=lambda found: found[1])
                    break
        return nearest

    def first_on(self, lane_index: LaneIndex) -> tuple[Any, float]:
        """(the first car on the lane, its centre's place along it in m)."""
        if not self._moving:
            self._refresh()
        places, cars = self._occupants(lane_index)
        return (cars[0], places[0]) if cars else NOBODY

    def occupants(self, lane_index: LaneIndex) -> list[tuple[float, Any, bool]]:
        """(place along it in m, car, whether it drives its way) of who is on the lane or changing onto it, in order."""
        places, cars = self._occupants(lane_index)
        return [(place, car, not self._comes(lane_index, car)) for place, car in zip(places, cars, strict=True)]

    def _comes(self, lane_index: LaneIndex, car: Any) -> bool:
        """Whether the car drives the other way, where somebody may."""
        if not self.graph.against:
            return False
        return not self._projection.aligned(self._projection.number[lane_index], self._column[id(car)], math.pi / 2)

    def _comes_later(self, vehicle: Any, lane_index: LaneIndex, car: Any, gap_m: float) -> bool:
        """Whether the car comes the other way, and is too far away to brake for."""
        if not self._comes(lane_index, car):
            return False
        own = lane_index not in self.graph.against or getattr(vehicle, "falls_back", False)
        return bool(gap_m > (MEETS_S if own else MEETS_PASSING_S) * (vehicle.speed + car.speed))

    def changing_onto(self, lane_index: LaneIndex) -> list[Any]:
        """The cars on that lane, and those that are about to be."""
        return self._occupants(lane_index)[1]

    def _occupants(self, lane_index: Any) -> tuple[list[float], list[Any]]:
        """Cars on the lane or changing onto it, with their places along it, in order."""
        found = self._on_lane.get(lane_index)
        if found is None:
            if self._reaching is None:
                self._reaching = self._projection.reaching()
            lane = self._projection.number[lane_index]
            along, reaches = self._projection.along_m[lane], self._reaching[lane]
            everybody = self._cars or []
            order = sorted(
                (along[number], number)
                for number, car in enumerate(everybody)
                if reaches[number] or getattr(car, "target_lane_index", None) == lane_index
            )
            found = self._on_lane[lane_index] = [place for place, _ in order], [everybody[n] for _, n in order]
        return found


class StyledRegulatedRoad(RegulatedRoad, StyledRoad):  # type: ignore[misc]
    """The same with highway-env's right-of-way rules (its `step` calls the one above)."""
