"""`CityMap`: the lanes of a whole city, of which each scene gets those around its road users."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from stylesim.road import Lane, Road
from stylesim.tracks import Tracks

REACH_MPS = 25.0  # chosen: at 90 km/h nobody leaves the road that his scene has


@dataclass(frozen=True, eq=False)
class CityMap:
    """All lanes of a city in metres from `origin_m`, which is in the map's frame, as crosswalks are.

    `incomplete` lanes of the file were left out, because they have no usable line.
    """

    lanes: tuple[Lane, ...]
    crosswalks_m: tuple[Float64[np.ndarray, "_ 2"], ...]
    origin_m: Float64[np.ndarray, " 2"]
    incomplete: int = 0

    @cached_property
    def _boxes(self) -> Float64[np.ndarray, "lane 2 2"]:
        """The lowest and highest corner of each lane, in the map's frame."""
        lines = [lane.centre_line_m.astype(np.float64) for lane in self.lanes]
        corners = np.array([(line.min(axis=0), line.max(axis=0)) for line in lines]).reshape(-1, 2, 2)
        return corners + self.origin_m

    def around(self, tracks: Tracks, seconds: float) -> Road | None:
        """The lanes within reach of those who are there in the first frame with anyone; None where there is none.

        How the scene goes on decides nothing: a road that ends where a car went would tell where it went. The reach
        is what REACH_MPS covers in so many seconds.
        """
        if not tracks.valid.any():
            return None
        first = int(tracks.valid.any(axis=0).argmax())
        place = tracks.position_m[tracks.valid[:, first], first].astype(np.float64) + tracks.origin_m
        low, high = place.min(axis=0) - REACH_MPS * seconds, place.max(axis=0) + REACH_MPS * seconds
        near = ((self._boxes[:, 0] <= high) & (self._boxes[:, 1] >= low)).all(axis=1)
        chosen = [self.lanes[i] for i in np.flatnonzero(near)]
        if not chosen:
            return None
        known = {lane.lane_id for lane in chosen}
        shift = self.origin_m - tracks.origin_m
        walks = [w for w in self.crosswalks_m if (w.min(axis=0) <= high).all() and (w.max(axis=0) >= low).all()]
        return Road(
            lanes=tuple(_moved(lane, shift, known) for lane in chosen),
            source="map",
            crosswalks_m=tuple((walk - tracks.origin_m).astype(np.float32) for walk in walks),
        )


def _moved(lane: Lane, by_m: Float64[np.ndarray, " 2"], known: Collection[str]) -> Lane:
    """The lane moved, with links to `known` lanes only."""

    def line(name: str) -> np.ndarray | None:
        value = getattr(lane, name)
        return None if value is None else (value.astype(np.float64) + by_m).astype(np.float32)

    return replace(
        lane,
        centre_line_m=(lane.centre_line_m.astype(np.float64) + by_m).astype(np.float32),
        left_boundary_m=line("left_boundary_m"),
        right_boundary_m=line("right_boundary_m"),
        stop_line_m=line("stop_line_m"),
        successors=tuple(i for i in lane.successors if i in known),
        left_neighbour=lane.left_neighbour if lane.left_neighbour in known else "",
        right_neighbour=lane.right_neighbour if lane.right_neighbour in known else "",
    )
