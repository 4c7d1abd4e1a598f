"""Gap acceptance at the junction: who has lower priority waits at the line for a gap as long as its style wants.

highway-env's regulation looks 3 s ahead at constant speed and makes the lower priority stop wherever it is, often in
the middle of the junction. It stays as it is; this adds what a driver decides before, at the line [ours].
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from highway_env.road.road import RoadNetwork

from stylesim.simulation.highway.path import lanes_ahead, stopping_m
from stylesim.simulation.highway.vehicle import StyledVehicle

TOUCH_M = 3.0  # two paths closer than this conflict: a car is 2 m wide, and 0.5 m is kept on each side
OVER_LINE_M = 1.5  # who stands that far beyond the line still waits
CREEP_MPS = 1.0  # least speed in arrival times: a standing car may start


class RightOfWay:
    """Which paths through a junction conflict, and who must wait at its line."""

    def __init__(self, network: RoadNetwork, *, junction_nodes: str) -> None:
        self._inner = {
            index: lane
            for index, lane in network.lanes_dict().items()
            if index[0].startswith(junction_nodes) and index[1].startswith(junction_nodes)
        }
        lines = {
            index: np.array([lane.position(s, 0.0) for s in np.linspace(0, lane.length, 16)])
            for index, lane in self._inner.items()
        }
        self._conflicts = {
            a: {
                b
                for b in lines
                if b[0] != a[0] and np.linalg.norm(lines[a][:, None] - lines[b][None], axis=-1).min() < TOUCH_M
            }
            for a in lines
        }

    def assign(self, vehicles: Iterable[StyledVehicle]) -> None:
        """Set `waits_for_gap` of every car."""
        cars = list(vehicles)
        arrivals = [(car, *arrival) for car in cars if (arrival := self._arrival(car)) is not None]
        for car in cars:
            car.waits_for_gap = False
        for car, leg, distance, _ in arrivals:
            if car.style is None or distance < -OVER_LINE_M or (distance < 0 and car.speed > CREEP_MPS):
                continue
            hard, soft = stopping_m(car.speed, 2 * car.style.comfortable_deceleration_mps2), stopping_m(
                car.speed, car.style.comfortable_deceleration_mps2
            )
            if hard <= max(distance, 0.0) <= soft + car.speed * car.style.reaction_time_s + car.LENGTH:
                car.waits_for_gap = any(
                    self._goes_first(other_leg, leg) and time < car.style.gap_acceptance_s
                    for other, other_leg, _, time in arrivals
                    if other is not car
                )

    def _goes_first(self, other: Any, own: Any) -> bool:
        return other in self._conflicts[own] and self._inner[other].priority > self._inner[own].priority

    def _arrival(self, car: StyledVehicle) -> tuple[Any, float, float] | None:
        """(path through the junction, m from bumper to its line, s until it is there); None if there is none ahead."""
        here = car.target_lane_index
        if here in self._inner:
            return here, -car.LENGTH, 0.0
        leg = next((leg for leg in car.route or [] if leg[:2] != here[:2]), None)
        if leg is None or (*leg[:2], 0) not in self._inner:
            return None
        start = next((distance for distance, _ in lanes_ahead(car)), 0.0)
        distance = start - car.LENGTH / 2
        return (*leg[:2], 0), distance, max(distance, 0.0) / max(car.speed, CREEP_MPS)
