"""Every car on every lane at once: place along and across each lane, in numpy instead of car by car."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane, CircularLane, SineLane, StraightLane
from highway_env.road.road import RoadNetwork
from jaxtyping import Float64

from stylesim.simulation.highway.path import CLEAR_M

Rows = list[list[float]]


class Projection:
    """The lanes of a network in the order in which highway-env searches them; `update` projects cars onto all.

    `along_m[lane][car]` and `aside_m[lane][car]` (to the right) are highway-env's own local coordinates, `distance`
    its distance with heading; all equal to the lane's answers up to rounding, which a test compares.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self.index: list[tuple[str, str, int]] = list(network.lanes_dict())
        self.number = {index: number for number, index in enumerate(self.index)}
        self.lane: list[AbstractLane] = list(network.lanes_dict().values())
        self.length_m = [float(lane.length) for lane in self.lane]
        self._lengths = np.array(self.length_m)[:, None]
        straight = [isinstance(lane, StraightLane) for lane in self.lane]  # sine lanes are straight with a bend on top
        self._straight = [n for n, flag in enumerate(straight) if flag]
        self._bent = [n for n in self._straight if isinstance(self.lane[n], SineLane)]
        self._round = [n for n, lane in enumerate(self.lane) if isinstance(lane, CircularLane)]
        self._other = [n for n, lane in enumerate(self.lane) if not straight[n] and n not in self._round]
        chosen: list[Any] = [self.lane[n] for n in self._straight]
        self._start = np.array([lane.start for lane in chosen], np.float64).reshape(-1, 2)
        self._direction = np.array([lane.direction for lane in chosen], np.float64).reshape(-1, 2)
        self._heading = np.array([lane.heading for lane in chosen], np.float64)
        self.along_m: Rows = []
        self.aside_m: Rows = []

    def update(self, cars: Sequence[Any]) -> None:
        """Project these cars (and objects), in this order."""
        count = len(cars)
        place = np.array([car.position for car in cars], np.float64).reshape(count, 2)
        self._heading_of = np.array([car.heading for car in cars], np.float64)
        self._extent_of = np.array([[car.LENGTH, car.WIDTH] for car in cars], np.float64).reshape(count, 2)
        along, aside, angle = (np.zeros((len(self.lane), count)) for _ in range(3))
        dx = place[None, :, 0] - self._start[:, :1]
        dy = place[None, :, 1] - self._start[:, 1:]
        ux, uy = self._direction[:, :1], self._direction[:, 1:]
        along[self._straight] = dx * ux + dy * uy
        aside[self._straight] = dy * ux - dx * uy
        angle[self._straight] = self._heading_of - self._heading[:, None]
        for n in self._bent:
            lane: Any = self.lane[n]
            phase = lane.pulsation * along[n] + lane.phase
            aside[n] -= lane.amplitude * np.sin(phase)
            angle[n] -= np.arctan(lane.amplitude * lane.pulsation * np.cos(phase))
        for n in self._round:
            along[n], aside[n], angle[n] = self._on_circle(self.lane[n], place)
        for n in self._other:
            lane = self.lane[n]
            for number, car in enumerate(cars):
                along[n, number], aside[n, number] = lane.local_coordinates(car.position)
                angle[n, number] = car.heading - lane.heading_at(along[n, number])
        self._along, self._aside = along, aside
        self._angle = (angle + math.pi) % (2.0 * math.pi) - math.pi
        self.along_m, self.aside_m = along.tolist(), aside.tolist()

    def _on_circle(self, lane: Any, place: Float64[np.ndarray, "car 2"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        delta = place - lane.center
        turned = np.arctan2(delta[:, 1], delta[:, 0]) - lane.start_phase
        turned = (turned + math.pi) % (2.0 * math.pi) - math.pi
        heading = lane.start_phase + turned + math.pi / 2 * lane.direction
        aside = lane.direction * (lane.radius - np.hypot(delta[:, 0], delta[:, 1]))
        return lane.direction * turned * lane.radius, aside, self._heading_of - heading

    def closest(self) -> list[int]:
        """Number of the closest lane of each car by highway-env's distance with heading, the first of equals."""
        beyond = np.maximum(self._along - self._lengths, 0.0) + np.maximum(-self._along, 0.0)
        return (np.abs(self._aside) + beyond + np.abs(self._angle)).argmin(axis=0).tolist()

    def reaching(self) -> list[list[bool]]:
        """[lane][car]: does the car reach into the way of one that follows the lane's centre (`path.reaches_into`)?"""
        half = AbstractLane.VEHICLE_LENGTH / 2
        beside = (self._along >= -half) & (self._along < self._lengths + half)
        long, wide = self._extent_of[:, 0], self._extent_of[:, 1]
        extent = (long * np.abs(np.sin(self._angle)) + wide * np.abs(np.cos(self._angle))) / 2
        return (beside & (np.abs(self._aside) <= extent + CLEAR_M)).tolist()

    def aligned(self, lane: int, car: int, within_rad: float) -> bool:
        """Does the car's body point along the lane, within that angle?"""
        return bool(abs(self._angle[lane, car]) < within_rad)
