"""Drivers in SUMO who brake for somebody on foot."""

from __future__ import annotations

from typing import Any

from stylesim.simulation.crossing import Barrier
from stylesim.simulation.sumo.episode import DT_S, EpisodeFiles
from stylesim.simulation.sumo.stressor_acts import BRAKES_MODE, USUAL_SPEED_MODE
from stylesim.simulation.yielding import SIGHT_M, Yield


class Yielding:
    """On each lane that a walker crosses the driver nearest before its way brakes, until the walker has left it."""

    def __init__(self, sumo: Any, files: EpisodeFiles, planned: list[Barrier], walker: str) -> None:
        self._sumo, self._files, self._walker = sumo, files, walker
        self._planned = planned
        self._braking: dict[str, Yield] = {}  # lane -> who brakes there

    def step(self, now_s: float) -> bool:
        """False when the walker has left the last lane."""
        for barrier in self._planned:
            active = barrier.from_s <= now_s < barrier.until_s
            driver = self._next_driver(barrier) if active else ""
            before = self._braking.get(barrier.lane_id)
            if before is not None and before.driver != driver:
                self._release(self._braking.pop(barrier.lane_id).driver)
            if driver:
                self._brake(barrier, driver, now_s)
        return any(now_s < barrier.until_s for barrier in self._planned)

    def _next_driver(self, barrier: Barrier) -> str:
        """The nearest driver whose front has not reached the walker's way; "" for none in sight."""
        vehicle = self._sumo.vehicle
        places = [(vehicle.getLanePosition(n), n) for n in self._sumo.lane.getLastStepVehicleIDs(barrier.lane_id)]
        before = [(place, name) for place, name in places if barrier.along_m - SIGHT_M < place < barrier.along_m]
        name = max(before)[1] if before else ""
        return name if name in self._files.drivers else ""

    def _brake(self, barrier: Barrier, driver: str, now_s: float) -> None:
        vehicle = self._sumo.vehicle
        if barrier.lane_id not in self._braking:
            style = self._files.now[driver].style
            rng = self._files.stream(driver, f"response {self._walker}")
            self._braking[barrier.lane_id] = Yield.begin(driver, style, now_s, rng)
        speed = vehicle.getSpeed(driver)
        gap = barrier.along_m - vehicle.getLanePosition(driver)
        wanted = self._braking[barrier.lane_id].deceleration(now_s, speed_mps=speed, gap_m=gap, dt_s=DT_S)
        if wanted is not None:
            vehicle.setSpeedMode(driver, BRAKES_MODE)
            vehicle.setSpeed(driver, max(0.0, speed - wanted * DT_S))

    def _release(self, driver: str) -> None:
        if driver in self._sumo.vehicle.getIDList():
            self._sumo.vehicle.setSpeed(driver, -1.0)
            self._sumo.vehicle.setSpeedMode(driver, USUAL_SPEED_MODE)
