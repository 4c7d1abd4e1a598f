"""Mean, variance and maximum of a value over the frames of each (agent, window)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int, Int64

from stylesim.labelers.cuts import Cut


class Groups:
    """The frames of each window, as one flat order in which sums over a window are sums over neighbours."""

    def __init__(self, cut: Cut) -> None:
        self.shape = (cut.window.shape[0], cut.n_windows)
        self.frames: tuple[Int[np.ndarray, " frame"], ...] = np.nonzero(cut.window >= 0)
        self.group: Int64[np.ndarray, " frame"] = self.frames[0] * cut.n_windows + cut.window[self.frames]
        self.size = self.shape[0] * self.shape[1]

    def of(self, value: Float64[np.ndarray, "agent time"]) -> Series:
        """The known values of the windows' frames."""
        flat = value[self.frames]
        known = np.isfinite(flat)
        return Series(flat[known], self.group[known], self.size, self.shape)

    def count(self, chosen: Bool[np.ndarray, "agent time"]) -> Int64[np.ndarray, "agent window"]:
        """How many frames of each window are chosen."""
        return np.bincount(self.group[chosen[self.frames]], minlength=self.size).reshape(self.shape)


class Series:
    """The known values of one quantity, with the window that each belongs to."""

    def __init__(
        self,
        value: Float64[np.ndarray, " frame"],
        group: Int64[np.ndarray, " frame"],
        size: int,
        shape: tuple[int, int],
    ) -> None:
        self._value, self._group, self._size, self._shape = value, group, size, shape
        self._count = np.bincount(group, minlength=size)

    @property
    def count(self) -> Int64[np.ndarray, "agent window"]:
        """Known values in each window."""
        return self._count.reshape(self._shape)

    def _mean(self, value: Float64[np.ndarray, " frame"]) -> Float64[np.ndarray, " group"]:
        total = np.bincount(self._group, weights=value, minlength=self._size)
        return np.where(self._count > 0, total / np.maximum(self._count, 1), np.nan)

    def mean(self) -> Float64[np.ndarray, "agent window"]:
        """Mean of the known values; NaN where there is none."""
        return self._mean(self._value).reshape(self._shape)

    def variance(self) -> Float64[np.ndarray, "agent window"]:
        """Mean squared deviation from the window's mean; NaN where there is no value."""
        deviation = self._value - self._mean(self._value)[self._group]
        return self._mean(deviation * deviation).reshape(self._shape)

    def maximum(self) -> Float64[np.ndarray, "agent window"]:
        """Largest known value; NaN where there is none."""
        result = np.full(self._size, np.nan)
        if len(self._group):
            begin = np.flatnonzero(np.concatenate([[True], self._group[1:] != self._group[:-1]]))
            result[self._group[begin]] = np.maximum.reduceat(self._value, begin)
        return result.reshape(self._shape)
