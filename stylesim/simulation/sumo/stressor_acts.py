"""What a driver does under a stressor in SUMO, step by step, against its own car-following model."""

from __future__ import annotations

from typing import Any

from stylesim.simulation.sumo.episode import DT_S
from stylesim.simulation.sumo.surroundings import Here

USUAL_SPEED_MODE = 31  # SUMO's: safe speed, limits of acceleration, right of way, red lights
BRAKES_MODE = 27  # without the limit of (comfortable) deceleration
RUNS_MODE = 7  # without right of way and red lights; still no faster than what keeps it off its leader
USUAL_CHANGE_MODE = 0b011001010101
BLIND_CHANGE_MODE = 0  # changes when it is told to, whoever is there
RUNS_FOR_S = 12.0  # a junction is left behind by then
LEAST_MPS2 = 0.5  # with which the braking ends
JERK_MPS3 = 12.0  # how fast the braking builds up; people stay below 15


class Braking:
    """Brakes to a speed, holds it, and drives on."""

    def __init__(self, sumo: Any, here: Here, braking_mps2: float, to_mps: float, hold_s: float) -> None:
        self._sumo, self._driver = sumo, here.driver
        self._speed, self._most, self._to, self._hold_s = here.speed_mps, braking_mps2, to_mps, hold_s
        self._braking = 0.0
        self._held_since: float | None = None
        sumo.vehicle.setSpeedMode(here.driver, BRAKES_MODE)

    def step(self, now_s: float) -> bool:
        """False when the driver drives on, or has left."""
        vehicle = self._sumo.vehicle
        if self._driver not in vehicle.getIDList():
            return False
        if self._held_since is not None and now_s - self._held_since >= self._hold_s:
            vehicle.setSpeed(self._driver, -1.0)
            vehicle.setSpeedMode(self._driver, USUAL_SPEED_MODE)
            return False
        ease = self._braking**2 / (2 * JERK_MPS3)  # speed that is lost while the braking fades out
        rise = -1.0 if self._speed - self._to <= ease + self._braking * DT_S else 1.0
        self._braking = min(self._most, max(LEAST_MPS2, self._braking + rise * JERK_MPS3 * DT_S))
        self._speed = max(self._to, min(self._speed, vehicle.getSpeed(self._driver)) - self._braking * DT_S)
        if self._speed <= self._to and self._held_since is None:
            self._held_since = now_s
        vehicle.setSpeed(self._driver, self._speed)
        return True


class CuttingIn:
    """Changes onto the lane beside in the time that was drawn, whoever comes there."""

    def __init__(self, sumo: Any, here: Here, lane_index: int, duration_s: float, now_s: float) -> None:
        self._sumo, self._driver, self._until_s = sumo, here.driver, now_s + duration_s + 1.0
        self._type = sumo.vehicle.getTypeID(here.driver)  # its own; `vehicle.setMaxSpeedLat` would make another one
        self._pace_mps = sumo.vehicle.getMaxSpeedLat(here.driver)
        width = sumo.lane.getWidth(here.lane)
        sumo.vehicle.setLaneChangeMode(here.driver, BLIND_CHANGE_MODE)
        sumo.vehicletype.setMaxSpeedLat(self._type, max(self._pace_mps, width / duration_s))
        sumo.vehicle.changeLane(here.driver, lane_index, duration_s + 1.0)

    def step(self, now_s: float) -> bool:
        """False when it is over."""
        if self._driver not in self._sumo.vehicle.getIDList():
            return False
        if now_s < self._until_s:
            return True
        self._sumo.vehicle.setLaneChangeMode(self._driver, USUAL_CHANGE_MODE)
        self._sumo.vehicletype.setMaxSpeedLat(self._type, self._pace_mps)
        return False


class RunningRed:
    """Drives through the junction ahead as if it had the right of way."""

    def __init__(self, sumo: Any, here: Here, now_s: float) -> None:
        self._sumo, self._driver, self._until_s = sumo, here.driver, now_s + RUNS_FOR_S
        self._inside = False
        sumo.vehicle.setSpeedMode(here.driver, RUNS_MODE)
        sumo.vehicle.setSpeed(here.driver, here.speed_mps)

    def step(self, now_s: float) -> bool:
        """False when the junction is left behind."""
        vehicle = self._sumo.vehicle
        if self._driver not in vehicle.getIDList():
            return False
        inside = vehicle.getRoadID(self._driver).startswith(":")
        if (self._inside and not inside) or now_s >= self._until_s:
            vehicle.setSpeed(self._driver, -1.0)
            vehicle.setSpeedMode(self._driver, USUAL_SPEED_MODE)
            return False
        self._inside |= inside
        return True
