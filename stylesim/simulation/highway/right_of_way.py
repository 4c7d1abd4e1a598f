"""Gap acceptance at the junction: drivers wait at the line for a gap as long as their style wants.

They wait for who has the higher priority, for who comes first among equals, and for anybody already in their way.

highway-env's regulation looks 3 s ahead at constant speed and makes the lower priority stop wherever it is, often in
the middle of the junction. It stays as it is; this adds what a driver decides before, at the line [ours].
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from highway_env.road.road import RoadNetwork

from stylesim.simulation.highway.path import YIELD_HARD, lanes_ahead, stopping_m
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.style import DriverStyle

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
        coming = [(car, *arrival) for car in cars if (arrival := self._arrival(car)) is not None]
        for car in cars:
            car.waits_for_gap = False
        for car, leg, distance, time in coming:
            if car.style is None or not self._looks(car, car.style, distance):
                continue
            car.waits_for_gap = any(
                other is not car
                and other_leg in self._conflicts[leg]
                and other_time < car.style.gap_acceptance_s
                and (other_distance <= -other.LENGTH or self._goes_first(other_leg, other_time, leg, time))
                for other, other_leg, other_distance, other_time in coming
            )

    def _looks(self, car: StyledVehicle, style: DriverStyle, distance: float) -> bool:
        """True from where it would brake comfortably for the line to where it could no longer stop there."""
        if distance < -OVER_LINE_M or (distance < 0 and car.speed > CREEP_MPS):
            return False
        ease = style.comfortable_deceleration_mps2
        first = stopping_m(car.speed, ease) + car.speed * style.reaction_time_s + car.LENGTH
        return bool(stopping_m(car.speed, YIELD_HARD * ease) <= max(distance, 0.0) <= first)

    def _goes_first(self, other: Any, other_time: float, own: Any, own_time: float) -> bool:
        """The higher priority goes first; among equals, who comes first."""
        theirs, ours = self._inner[other].priority, self._inner[own].priority
        return bool(theirs > ours or (theirs == ours and other_time < own_time))

    def _arrival(self, car: StyledVehicle) -> tuple[Any, float, float] | None:
        """(path through the junction, m from bumper to its line, s until it is there); None if there is none ahead.

        Inside the junction the distance is minus a car's length and the time 0.
        """
        here = car.target_lane_index
        if here in self._inner:
            return here, -car.LENGTH, 0.0
        leg = next((leg for leg in car.route or [] if leg[:2] != here[:2]), None)
        if leg is None or (*leg[:2], 0) not in self._inner:
            return None
        start = next((distance for distance, _ in lanes_ahead(car)), 0.0)
        distance = start - car.LENGTH / 2
        return (*leg[:2], 0), distance, max(distance, 0.0) / max(car.speed, CREEP_MPS)
