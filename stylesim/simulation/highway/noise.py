"""The Ornstein-Uhlenbeck process behind the restless pedal and the wander in the lane."""

from __future__ import annotations

import math

import numpy as np

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
