"""The Ornstein-Uhlenbeck processes behind the restless pedal and the wander in the lane."""

from __future__ import annotations

import math

import numpy as np

from stylesim.simulation.wander import FILTER_RAD_PER_S, FULL_SPEED_MPS, LARGEST_ACCELERATION_MPS2, filter_gain
from stylesim.style import DriverStyle

_BLOCK = 256  # normal deviates drawn at once: a scalar draw costs as much as a small block


class OrnsteinUhlenbeck:
    """A stationary process of given standard deviation and correlation time, stepped exactly for any dt.

    With `smoothing_s` the process runs through a first-order lag, so that its `rate` exists; the input is
    scaled by sqrt((T + tau) / T) so that the output keeps the standard deviation `sd` [ours, from the spectrum].
    """

    def __init__(self, sd: float, time_s: float, rng: np.random.Generator, *, smoothing_s: float = 0.0) -> None:
        self._rng = rng
        self._sd = sd * math.sqrt((time_s + smoothing_s) / time_s)
        self._time_s = time_s
        self._smoothing_s = smoothing_s
        self._deviates: list[float] = []
        self._raw = self._sd * self._deviate()
        self.value = self._raw * (time_s / (time_s + smoothing_s))  # the lag's mean, given the input
        self.rate = 0.0

    def retune(self, sd: float, time_s: float, rng: np.random.Generator | None = None) -> None:
        """Go on from where it is with another deviation and time, and with `rng` from other draws."""
        self._sd = sd * math.sqrt((time_s + self._smoothing_s) / time_s)
        self._time_s = time_s
        if rng is not None:
            self._rng, self._deviates = rng, []

    def _deviate(self) -> float:
        if not self._deviates:
            self._deviates = self._rng.standard_normal(_BLOCK).tolist()
        return self._deviates.pop()

    def step(self, dt: float) -> float:
        """The value dt seconds later; `rate` is the slope of that step, 1/s."""
        keep = math.exp(-dt / self._time_s)
        self._raw = keep * self._raw + self._sd * math.sqrt(1.0 - keep * keep) * self._deviate()
        before = self.value
        follow = 1.0 - math.exp(-dt / self._smoothing_s) if self._smoothing_s > 0 else 1.0
        self.value += follow * (self._raw - self.value)
        self.rate = (self.value - before) / dt
        return self.value


class Wander:
    """The place in the lane that a driver steers for, m to the right: the law of `simulation.wander`, step by step.

    An Ornstein-Uhlenbeck target, softly bounded, followed by a critically damped filter of limited acceleration;
    time runs with the speed below 5 m/s.
    """

    def __init__(self, style: DriverStyle, *, room_m: float, rng: np.random.Generator) -> None:
        time_s = np.array([style.lane_wander_time_s])
        self._sd_m = style.lane_wander_m / float(filter_gain(time_s)[0])
        self._time_s = style.lane_wander_time_s
        self._room_m = max(room_m, 1e-3)
        self._rng = rng
        self._deviates: list[float] = []
        self._target_m = self._sd_m * self._deviate()
        self.value = self._room_m * math.tanh(self._target_m / self._room_m)
        self.rate = 0.0
        self.pull = 0.0

    def retune(self, style: DriverStyle, rng: np.random.Generator | None = None) -> None:
        """Go on from where it is as another style, and with `rng` from other draws."""
        self._sd_m = style.lane_wander_m / float(filter_gain(np.array([style.lane_wander_time_s]))[0])
        self._time_s = style.lane_wander_time_s
        if rng is not None:
            self._rng, self._deviates = rng, []

    def _deviate(self) -> float:
        if not self._deviates:
            self._deviates = self._rng.standard_normal(_BLOCK).tolist()
        return self._deviates.pop()

    def step(self, dt: float, speed_mps: float) -> None:
        """`value`, its `rate` (m/s) and the `pull` on that (m/s2) dt seconds later."""
        pace = dt * min(max(speed_mps, 0.0) / FULL_SPEED_MPS, 1.0)
        keep = math.exp(-pace / self._time_s)
        self._target_m = keep * self._target_m + self._sd_m * math.sqrt(1.0 - keep * keep) * self._deviate()
        goal = self._room_m * math.tanh(self._target_m / self._room_m)
        pull = FILTER_RAD_PER_S**2 * (goal - self.value) - 2.0 * FILTER_RAD_PER_S * self.rate
        self.pull = min(max(pull, -LARGEST_ACCELERATION_MPS2), LARGEST_ACCELERATION_MPS2)
        self.rate += pace * self.pull
        self.value += pace * self.rate
