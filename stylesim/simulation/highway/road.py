"""highway-env's roads with the searches that cost the time done once per step instead of once per question."""

from __future__ import annotations

from bisect import bisect_left
from typing import Any

import numpy as np
from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import Road
from highway_env.vehicle.objects import Landmark

from stylesim.simulation.highway.path import leader_beyond, reaches_into
from stylesim.simulation.highway.quick import quicken


class StyledRoad(Road):  # type: ignore[misc]
    """Neighbours from a list per lane, collisions checked for near pairs only.

    A car is a neighbour on a lane if it reaches into it, or is changing onto it. highway-env takes every centre
    within a metre of the lane instead, so that a car which wanders in the next lane would be braked for.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        quicken(self.network)
        self.collided_pairs: set[frozenset[str]] = set()
        self._on_lane: dict[Any, tuple[list[float], list[Any]]] = {}

    def neighbour_vehicles(self, vehicle: Any, lane_index: Any = None) -> tuple[Any, Any]:
        """The cars in front of and behind `vehicle` on that lane; on its route also beyond the lane's end."""
        routed = bool(getattr(vehicle, "route", None))
        if lane_index is None or routed:  # where paths part, the nearest lane may be one that it does not follow
            lane_index = vehicle.target_lane_index if routed else vehicle.lane_index
        if lane_index not in self._on_lane:
            self._on_lane[lane_index] = self._occupants(lane_index)
        places, cars = self._on_lane[lane_index]
        here = self.network.get_lane(lane_index).local_coordinates(vehicle.position)[0]
        at = bisect_left(places, here)
        front = next((car for car in cars[at:] if car is not vehicle), None)
        rear = next((car for car in reversed(cars[:at]) if car is not vehicle), None)
        if front is None and routed:
            front = leader_beyond(vehicle)
        return front, rear

    def _occupants(self, lane_index: Any) -> tuple[list[float], list[Any]]:
        lane = self.network.get_lane(lane_index)
        found = []
        for number, car in enumerate(self.vehicles + [o for o in self.objects if not isinstance(o, Landmark)]):
            along, lateral = lane.local_coordinates(car.position)
            if reaches_into(lane, along, lateral, car) or getattr(car, "target_lane_index", None) == lane_index:
                found.append((along, number, car))
        found.sort(key=lambda item: item[:2])
        return [along for along, _, _ in found], [car for _, _, car in found]

    def step(self, dt: float) -> None:
        """Move every car, then let the pairs that could touch check for a collision."""
        self._on_lane.clear()
        for vehicle in self.vehicles:
            vehicle.step(dt)
        if len(self.vehicles) > 1:
            place = np.array([vehicle.position for vehicle in self.vehicles])
            reach = max(vehicle.diagonal + abs(vehicle.speed) * dt for vehicle in self.vehicles)
            apart = np.abs(place[:, None] - place[None]).max(axis=-1)
            for i, j in np.argwhere(np.triu(apart <= reach, k=1)):
                self.vehicles[i].handle_collisions(self.vehicles[j], dt)
        for vehicle in self.vehicles:
            for other in self.objects:
                vehicle.handle_collisions(other, dt)


class StyledRegulatedRoad(RegulatedRoad, StyledRoad):  # type: ignore[misc]
    """The same with highway-env's right-of-way rules (its `step` calls the one above)."""
