"""Every driver's own normal draws, one at a time, in the order in which a recorded episode takes them at once."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.simulation.sumo.episode import Episode

BLOCK = 1024  # draws taken from a driver's stream at once


class Draws:
    """The streams of one purpose; a driver's begins with its first draw."""

    def __init__(self, files: Episode, purpose: str) -> None:
        self._files, self._purpose, self._names = files, purpose, tuple(files.drivers)
        self._values = np.zeros((len(self._names), BLOCK))
        self._next = np.full(len(self._names), BLOCK)
        self._rng: dict[int, np.random.Generator] = {}

    def next(self, rows: Int64[np.ndarray, " vehicle"]) -> Float64[np.ndarray, " vehicle"]:
        """The next draw of each of these drivers (places in the episode's order)."""
        for row in rows[self._next[rows] >= BLOCK].tolist():
            if row not in self._rng:
                self._rng[row] = self._files.stream(self._names[row], self._purpose)
            self._values[row] = self._rng[row].standard_normal(BLOCK)
            self._next[row] = 0
        result = self._values[rows, self._next[rows]]
        self._next[rows] += 1
        return np.asarray(result)
