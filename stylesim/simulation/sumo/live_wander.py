"""The lateral wander of `simulation.wander`, advanced step by step instead of over a whole log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.simulation.sumo.episode import DT_S, Episode
from stylesim.simulation.sumo.live_draws import Draws
from stylesim.simulation.sumo.vehicles import Driver
from stylesim.simulation.wander import (
    FILTER_RAD_PER_S,
    FULL_SPEED_MPS,
    LARGEST_ACCELERATION_MPS2,
    ROOM_BEYOND_LANE_M,
    filter_gain,
)


class Wander:
    """Every driver's place in its lane; the same target, filter, limits and streams as in a recorded episode."""

    def __init__(self, files: Episode) -> None:
        self._drivers: Sequence[Driver] = tuple(files.drivers.values())
        narrowest = min(lane.width_m for lane in files.network.road.lanes)
        width = np.array([driver.width_m for driver in self._drivers], np.float64)
        self._time_s = np.array([driver.style.lane_wander_time_s for driver in self._drivers], np.float64)
        sd_m = np.array([driver.style.lane_wander_m for driver in self._drivers], np.float64)
        self._sd_m = sd_m / filter_gain(self._time_s)
        self._limit_m = np.maximum((narrowest - width) / 2 + ROOM_BEYOND_LANE_M, 1e-3)
        self._target, self._offset, self._rate = (np.zeros(len(self._drivers)) for _ in range(3))
        self._draws = Draws(files, "wander")
        self._begun = np.zeros(len(self._drivers), bool)

    def advance(
        self, rows: Int64[np.ndarray, " vehicle"], speed_mps: Float64[np.ndarray, " vehicle"]
    ) -> tuple[Float64[np.ndarray, " vehicle"], Float64[np.ndarray, " vehicle"]]:
        """One step of 0.1 s of these drivers: offsets to the left of the path, m, and their rates, m/s."""
        fresh = rows[~self._begun[rows]]
        if len(fresh):
            self._begin(fresh)
        shock = self._draws.next(rows)
        pace_s = DT_S * np.minimum(1.0, speed_mps / FULL_SPEED_MPS)
        keep = np.exp(-pace_s / self._time_s[rows])
        limit, offset, rate = self._limit_m[rows], self._offset[rows], self._rate[rows]
        target = keep * self._target[rows] + shock * np.sqrt(1.0 - keep**2) * self._sd_m[rows]
        pull = FILTER_RAD_PER_S**2 * (limit * np.tanh(target / limit) - offset) - 2.0 * FILTER_RAD_PER_S * rate
        rate = rate + pace_s * np.clip(pull, -LARGEST_ACCELERATION_MPS2, LARGEST_ACCELERATION_MPS2)
        offset = offset + pace_s * rate
        self._target[rows], self._rate[rows], self._offset[rows] = target, rate, offset
        return offset, rate * pace_s / DT_S

    def _begin(self, rows: Int64[np.ndarray, " vehicle"]) -> None:
        self._begun[rows] = True
        self._target[rows] = self._draws.next(rows) * self._sd_m[rows]
        self._offset[rows] = self._limit_m[rows] * np.tanh(self._target[rows] / self._limit_m[rows])
