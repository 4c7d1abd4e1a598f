"""The way of one driver as a line along lanes: places along it, what lies beside it, how it bends."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from stylesim.geometry import wrap_angle

SPACING_M = 1.0
OVERLAP_M = 15.0  # of two centre lines where lanes join, at most
ROUND_M = 6.0  # chosen: the corners of inferred and drawn lines disappear, a turn of 8 m radius moves by half a metre
BEND_M = 5.0  # over which the curvature is taken; chosen, because inferred and drawn centre lines are polygons


@dataclass(frozen=True, eq=False)
class Path:
    """Points every metre; `lanes` are (place of its start along the path, lane id) in order."""

    point_m: Float64[np.ndarray, "point 2"]
    lanes: tuple[tuple[float, str], ...]

    @classmethod
    def along(cls, pieces: list[tuple[str, Float64[np.ndarray, "_ 2"]]]) -> Path:
        """The centre lines one after the other, resampled and rounded. ValueError where they have no length."""
        starts: list[tuple[float, str]] = []
        line = np.zeros((0, 2))
        for lane_id, piece in pieces:
            piece = _beyond(line, piece)
            starts.append((_length(line), lane_id))
            line = np.concatenate([line, piece])
        line = _resampled(line)
        if len(line) > 2:
            line = _resampled(_rounded(line))
        return cls(line, tuple(starts))

    @cached_property
    def s_m(self) -> Float64[np.ndarray, " point"]:
        """Length along the path up to each point."""
        steps = np.hypot(*np.diff(self.point_m, axis=0).T)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def heading_rad(self) -> Float64[np.ndarray, " point"]:
        """Direction at each point, unwrapped."""
        ahead = np.gradient(self.point_m, axis=0)
        return np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))

    @cached_property
    def curvature_per_m(self) -> Float64[np.ndarray, " point"]:
        """Size of the bend at each point."""
        s, heading = self.s_m, self.heading_rad
        before, after = np.interp(s - BEND_M, s, heading), np.interp(s + BEND_M, s, heading)
        width = np.minimum(s + BEND_M, s[-1]) - np.maximum(s - BEND_M, 0.0)
        return np.abs(after - before) / np.maximum(width, 1.0)

    @property
    def length_m(self) -> float:
        """Of the whole path."""
        return float(self.s_m[-1])

    def project(self, places_m: Float64[np.ndarray, "place 2"]) -> tuple[np.ndarray, np.ndarray]:
        """(along, to the left) in m of each place, from its nearest point of the path."""
        nearest = np.empty(len(places_m), np.int64)
        for number, place in enumerate(places_m):
            nearest[number] = int(np.argmin(((self.point_m - place) ** 2).sum(axis=1)))
        heading = self.heading_rad[nearest]
        rest = places_m - self.point_m[nearest]
        along = rest[:, 0] * np.cos(heading) + rest[:, 1] * np.sin(heading)
        left = rest[:, 1] * np.cos(heading) - rest[:, 0] * np.sin(heading)
        return self.s_m[nearest] + along, left

    def at(self, s_m: Float64[np.ndarray, " frame"]) -> tuple[np.ndarray, np.ndarray]:
        """(places, headings) at those lengths along the path, straight on beyond its ends."""
        heading = np.interp(s_m, self.s_m, self.heading_rad)
        beyond = (s_m - np.clip(s_m, 0.0, self.length_m))[:, None]
        place = np.stack([np.interp(s_m, self.s_m, self.point_m[:, axis]) for axis in (0, 1)], axis=-1)
        return place + beyond * np.stack([np.cos(heading), np.sin(heading)], axis=-1), wrap_angle(heading)


def _length(line: Float64[np.ndarray, "_ 2"]) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum()) if len(line) > 1 else 0.0


def _beyond(line: Float64[np.ndarray, "_ 2"], piece: Float64[np.ndarray, "_ 2"]) -> Float64[np.ndarray, "_ 2"]:
    """The part of the next piece that lies ahead of the end of the line: centre lines may overlap where lanes join."""
    if len(line) < 2:
        return piece
    ahead = line[-1] - line[-2]
    before = (piece - line[-1]) @ ahead < 0.0
    first = int(np.argmin(before)) if not before.all() else len(piece) - 1
    near = np.hypot(*(piece[:first] - line[-1]).T) < OVERLAP_M if first else np.zeros(0, bool)
    return piece[first:] if near.all() else piece


def _resampled(line: Float64[np.ndarray, "_ 2"]) -> Float64[np.ndarray, "point 2"]:
    line = line[np.concatenate([[True], np.hypot(*np.diff(line, axis=0).T) > 1e-3])]
    if len(line) < 2:
        raise ValueError("a path needs two different points")
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = np.linspace(0.0, arc[-1], max(2, round(arc[-1] / SPACING_M) + 1))
    return np.stack([np.interp(at, arc, line[:, 0]), np.interp(at, arc, line[:, 1])], axis=1)


def _rounded(line: Float64[np.ndarray, "point 2"]) -> Float64[np.ndarray, "point 2"]:
    """A running mean (Hann window) over 2 * ROUND_M: nobody steers through the corners of a polygon."""
    half = round(ROUND_M / SPACING_M)
    window = np.hanning(2 * half + 3)[1:-1]
    before = line[0] + np.arange(-half, 0)[:, None] * (line[1] - line[0])
    after = line[-1] + np.arange(1, half + 1)[:, None] * (line[-1] - line[-2])
    padded = np.concatenate([before, line, after])
    return np.stack([np.convolve(padded[:, axis], window / window.sum(), "valid") for axis in (0, 1)], axis=1)
