"""What lies ahead of a car on its own path: the next lanes of its route, gaps along it, the speed of its curves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from highway_env.road.lane import AbstractLane, CircularLane

from stylesim.simulation.highway.graph import bend_radius_m

CLEAR_M = 1.3  # half a car's width and 0.3 m: what a path needs on either side of its centre
LANES_AHEAD = 2  # through the junction and onto the exit
ALIGNED_RAD = math.radians(60)  # who crosses is the regulation's business, who goes along is a leader
STANDING_MPS = 2.0  # and so is who crosses this slowly, or stands there
YIELD_HARD = 2.0  # chosen: who yields late brakes with twice its comfortable deceleration
IN_BEND_MPS2 = 2.4  # chosen: with what wander and the way back to the centre add it stays under 4 m/s2
BEFORE_BEND = 0.5  # chosen: with all of it cars entered the roundabout at twice the speed, and 14 m/s2 across
GENTLE_MPS2 = 1.0  # chosen: least braking of who yields, so that it comes to rest


def lanes_ahead(vehicle: Any) -> Iterator[tuple[float, AbstractLane]]:
    """(distance of its start from the vehicle, lane) for the lanes that follow on its route, nearest first."""
    road, index = vehicle.road, vehicle.target_lane_index
    start = road.graph.length_m[index] - road.place(vehicle, index)[0]
    for _ in range(LANES_AHEAD):
        onward = road.graph.onward(index, vehicle.route)
        if onward is None:
            return
        index = onward
        yield start, road.network.get_lane(index)
        start += road.graph.length_m[index]


def reaches_into(lane: AbstractLane, along_m: float, lateral_m: float, other: Any) -> bool:
    """True where a car at these lane coordinates is in the way of one that follows the lane's centre."""
    if not -lane.VEHICLE_LENGTH / 2 <= along_m < lane.length + lane.VEHICLE_LENGTH / 2:
        return False
    angle = other.heading - lane.heading_at(along_m)
    extent = (other.LENGTH * abs(math.sin(angle)) + other.WIDTH * abs(math.cos(angle))) / 2
    return bool(abs(lateral_m) <= extent + CLEAR_M)


def stopping_m(speed_mps: float, braking_mps2: float) -> float:
    """Distance that braking from that speed to rest takes, m."""
    return speed_mps**2 / (2 * braking_mps2)


def curve_speed_mps(vehicle: Any, comfort_mps2: float) -> float:
    """Speed that keeps the lateral acceleration within `comfort_mps2` in this curve and can be reached before the next.

    v = sqrt(a r) in a curve of radius r; sqrt(v^2 + 2 a d) at distance d before it, with half of the comfortable
    deceleration, because the car follows its wish late. The longitudinal comfort is taken for the lateral one too (a
    friction circle), up to `IN_BEND_MPS2` [ours]. Infinite on straight roads.
    """
    if not vehicle.road.graph.winds:
        return math.inf
    here = vehicle.road.network.get_lane(vehicle.target_lane_index)
    across_mps2, before_mps2 = min(comfort_mps2, IN_BEND_MPS2), BEFORE_BEND * comfort_mps2
    result = math.sqrt(across_mps2 * bend_radius_m(here))
    for start, lane in lanes_ahead(vehicle):
        radius = bend_radius_m(lane)
        if radius < math.inf:
            result = min(result, math.sqrt(across_mps2 * radius + 2 * before_mps2 * max(start, 0.0)))
    return result


def braking_to_yield_mps2(vehicle: Any, comfort_mps2: float) -> float:
    """Deceleration of a driver who yields: to the end of its lane if that is on the way into the junction.

    v^2 / (2 d) where that stops it before the line and at least `GENTLE_MPS2`; who is too close to stop with
    twice its comfortable deceleration, or is inside the junction, brakes with that [ours].
    """
    hard = YIELD_HARD * comfort_mps2
    start = next((distance for distance, _ in lanes_ahead(vehicle)), math.nan)
    room = start - vehicle.LENGTH / 2
    if not room > 0 or isinstance(vehicle.lane, CircularLane):
        return hard
    return float(min(max(vehicle.speed**2 / (2 * room), GENTLE_MPS2), hard))
