"""Which lanes a recorded driver is on, and which it goes on by: those that it really drove, where that is recorded."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from stylesim.geometry import wrap_angle
from stylesim.road import Lane, Road
from stylesim.simulation.rollout.path import Path

BESIDE_M = 2.5  # a driver farther from a centre line is not on that lane; chosen: half a wide lane and a little
ANGLE_RAD = np.radians(45.0)  # REFERENCE section 1: within 45 degrees traffic has the same direction
TRIED = 4  # lanes to begin with
CHAINS = 64  # ways on that are compared
DEEPEST = 60  # lanes of one way; protects from rings
LEAST_FUTURE_M = 5.0  # a recorded way shorter than that tells nothing about the route


class Lanes:
    """The lanes of a road, ready to be searched."""

    def __init__(self, road: Road) -> None:
        self.by_id = {lane.lane_id: lane for lane in road.lanes}
        self._line = {lane.lane_id: lane.centre_line_m.astype(np.float64) for lane in road.lanes}
        self._path = {name: Path.along([(name, line)]) for name, line in self._line.items() if _long(line)}
        self._low = np.array([line.min(axis=0) for line in self._line.values()])
        self._high = np.array([line.max(axis=0) for line in self._line.values()])
        self._names = list(self._line)

    def beneath(self, place_m: Float64[np.ndarray, " 2"], heading_rad: float) -> list[str]:
        """The lanes that somebody there can be on, nearest first."""
        near = ((self._low - BESIDE_M <= place_m) & (place_m <= self._high + BESIDE_M)).all(axis=1)
        found = []
        for number in np.flatnonzero(near):
            name = self._names[number]
            if name not in self._path:
                continue
            path = self._path[name]
            (along,), (left,) = path.project(place_m[None])
            if not -BESIDE_M <= along <= path.length_m + BESIDE_M or abs(left) > BESIDE_M:
                continue
            _, (course,) = path.at(np.array([along]))
            angle = abs(float(wrap_angle(np.array(heading_rad - course))))
            if angle <= ANGLE_RAD:
                found.append((abs(float(left)) + 2.0 * angle, name))
        return [name for _, name in sorted(found)]

    def _onward(self, lane: Lane) -> list[str]:
        return [name for name in lane.successors if name in self._path]

    def _chains(self, first: str, least_m: float) -> list[list[str]]:
        """Ways on from a lane that are so long or end."""
        done: list[list[str]] = []
        open_: list[tuple[list[str], float]] = [([first], self._path[first].length_m)]
        while open_ and len(done) < CHAINS:
            chain, length = open_.pop(0)
            onward = [name for name in self._onward(self.by_id[chain[-1]]) if name not in chain]
            if length >= least_m or not onward or len(chain) >= DEEPEST:
                done.append(chain)
                continue
            open_ += [([*chain, name], length + self._path[name].length_m) for name in onward]
        return done

    def _straightest(self, name: str) -> str | None:
        here = self._path[name].heading_rad[-1]
        onward = self._onward(self.by_id[name])
        turns = [(abs(float(wrap_angle(self._path[n].heading_rad[0] - here))), self._turn(n), n) for n in onward]
        return min(turns)[2] if turns else None

    def _turn(self, name: str) -> float:
        heading = self._path[name].heading_rad
        return abs(float(heading[-1] - heading[0]))

    def path(
        self,
        place_m: Float64[np.ndarray, " 2"],
        heading_rad: float,
        future_m: Float64[np.ndarray, "_ 2"],
        *,
        least_m: float,
    ) -> Path | None:
        """The way from there on, at least so long where the map allows it; None where no lane fits.

        Of the ways that the lanes allow it is the one nearest to where the driver went (`future_m`); beyond, and for
        who stayed, straight on.
        """
        went = float(np.hypot(*np.diff(future_m, axis=0).T).sum()) if len(future_m) > 1 else 0.0
        best: tuple[float, list[str]] | None = None
        for first in self.beneath(place_m, heading_rad)[:TRIED]:
            tried = self._chains(first, went + self._path[first].length_m) if went >= LEAST_FUTURE_M else [[first]]
            for chain in tried:
                path = Path.along([(name, self._line[name]) for name in chain])
                places = future_m if went >= LEAST_FUTURE_M else place_m[None]
                along, left = path.project(places)
                beyond = np.maximum(along - path.length_m, 0.0)
                score = float(np.mean(np.abs(left) + beyond))
                if best is None or score < best[0] - 1e-9:
                    best = score, chain
        if best is None:
            return None
        chain = list(best[1])
        length = sum(self._path[name].length_m for name in chain)
        while length < least_m and len(chain) < DEEPEST:
            onward = self._straightest(chain[-1])
            if onward is None:
                break
            chain.append(onward)
            length += self._path[onward].length_m
        return Path.along([(name, self._line[name]) for name in chain])


def _long(line: Float64[np.ndarray, "_ 2"]) -> bool:
    return bool(np.hypot(*np.diff(line, axis=0).T).sum() > 0.1)
