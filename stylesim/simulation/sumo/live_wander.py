"""The lateral wander of `simulation.wander`, advanced step by step instead of over a whole log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.randomness import stream
from stylesim.simulation.sumo.episode import DT_S, Episode
from stylesim.simulation.sumo.vehicles import Driver
from stylesim.simulation.wander import (
    FILTER_RAD_PER_S,
    FULL_SPEED_MPS,
    LARGEST_ACCELERATION_MPS2,
    ROOM_BEYOND_LANE_M,
    filter_gain,
)

BLOCK = 1024  # draws taken from a driver's stream at once


class Wander:
    """Every driver's place in its lane; the same target, filter, limits and streams as in a recorded episode."""

    def __init__(self, files: Episode) -> None:
        self._files = files
        self._drivers: Sequence[Driver] = tuple(files.drivers.values())
        narrowest = min(lane.width_m for lane in files.network.road.lanes)
        width = np.array([driver.width_m for driver in self._drivers], np.float64)
        self._time_s = np.array([driver.style.lane_wander_time_s for driver in self._drivers], np.float64)
        sd_m = np.array([driver.style.lane_wander_m for driver in self._drivers], np.float64)
        self._sd_m = sd_m / filter_gain(self._time_s)
        self._limit_m = np.maximum((narrowest - width) / 2 + ROOM_BEYOND_LANE_M, 1e-3)
        self._target, self._offset, self._rate = (np.zeros(len(self._drivers)) for _ in range(3))
        self._shocks = np.zeros((len(self._drivers), BLOCK))
        self._next = np.full(len(self._drivers), -1)  # of the shocks; -1 before the driver's first step
        self._rng: dict[int, np.random.Generator] = {}

    def advance(
        self, rows: Int64[np.ndarray, " vehicle"], speed_mps: Float64[np.ndarray, " vehicle"]
    ) -> tuple[Float64[np.ndarray, " vehicle"], Float64[np.ndarray, " vehicle"]]:
        """One step of 0.1 s of these drivers: offsets to the left of the path, m, and their rates, m/s."""
        for row in rows[self._next[rows] < 0]:
            self._begin(int(row))
        for row in rows[self._next[rows] >= BLOCK]:
            self._refill(int(row))
        shock = self._shocks[rows, self._next[rows]]
        self._next[rows] += 1
        pace_s = DT_S * np.minimum(1.0, speed_mps / FULL_SPEED_MPS)
        keep = np.exp(-pace_s / self._time_s[rows])
        limit, offset, rate = self._limit_m[rows], self._offset[rows], self._rate[rows]
        target = keep * self._target[rows] + shock * np.sqrt(1.0 - keep**2) * self._sd_m[rows]
        pull = FILTER_RAD_PER_S**2 * (limit * np.tanh(target / limit) - offset) - 2.0 * FILTER_RAD_PER_S * rate
        rate = rate + pace_s * np.clip(pull, -LARGEST_ACCELERATION_MPS2, LARGEST_ACCELERATION_MPS2)
        offset = offset + pace_s * rate
        self._target[rows], self._rate[rows], self._offset[rows] = target, rate, offset
        return offset, rate * pace_s / DT_S

    def _begin(self, row: int) -> None:
        driver_id = self._drivers[row].driver_id
        self._rng[row] = stream(self._files.seed, self._files.episode, driver_id, "wander")
        limit = self._limit_m[row]
        self._target[row] = self._rng[row].standard_normal() * self._sd_m[row]
        self._offset[row] = limit * np.tanh(self._target[row] / limit)
        self._refill(row)

    def _refill(self, row: int) -> None:
        self._shocks[row] = self._rng[row].standard_normal(BLOCK)
        self._next[row] = 0
