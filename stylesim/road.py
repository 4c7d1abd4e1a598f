"""`Road`: lanes with their geometry, in the frame of the tracks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from stylesim.arrays import frozen


@dataclass(frozen=True, eq=False)
class LaneEvidence:
    """From which tracks an inferred centre line was made, so that a driver can be left out of its own centre."""

    track_id: tuple[str, ...]
    offset_m: Float[np.ndarray, "track point"]  # to the left of the centre line; NaN where it was not seen

    def __post_init__(self) -> None:
        """Check the shape and freeze the array."""
        object.__setattr__(self, "offset_m", frozen(self.offset_m, np.float32, (len(self.track_id), None), "offset_m"))


@dataclass(frozen=True, eq=False)
class Lane:
    """One lane. Unknown numbers are NaN, unknown geometry is None, unknown neighbours are ""."""

    lane_id: str
    centre_line_m: Float[np.ndarray, "point 2"]  # in driving direction
    width_m: float = float("nan")
    speed_limit_mps: float = float("nan")
    left_boundary_m: Float[np.ndarray, "left 2"] | None = None
    right_boundary_m: Float[np.ndarray, "right 2"] | None = None
    successors: tuple[str, ...] = ()
    left_neighbour: str = ""
    right_neighbour: str = ""
    in_junction: bool = False
    stop_line_m: Float[np.ndarray, "2 2"] | None = None
    evidence: LaneEvidence | None = None

    def __post_init__(self) -> None:
        """Check shapes and freeze the arrays."""
        centre = frozen(self.centre_line_m, np.float32, (None, 2), "centre_line_m")
        if len(centre) < 2 or not np.isfinite(centre).all():
            raise ValueError(f"lane {self.lane_id!r}: a centre line needs two or more finite points")
        object.__setattr__(self, "centre_line_m", centre)
        for name, rows in (("left_boundary_m", None), ("right_boundary_m", None), ("stop_line_m", 2)):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, frozen(value, np.float32, (rows, 2), name))
        if self.evidence is not None and self.evidence.offset_m.shape[1] != len(centre):
            raise ValueError(f"lane {self.lane_id!r}: evidence and centre line differ in length")

    def without(self, track_id: str) -> Lane:
        """This lane with its centre line made from every contributing track but that one.

        The lane itself where the track gave no evidence; points that only this track had seen keep their place.
        """
        if self.evidence is None or track_id not in self.evidence.track_id:
            return self
        others = self.evidence.offset_m[[t != track_id for t in self.evidence.track_id]]
        seen = np.isfinite(others).any(axis=0) if len(others) else np.zeros(len(self.centre_line_m), bool)
        shift = np.zeros(len(self.centre_line_m))
        shift[seen] = np.nanmedian(others[:, seen], axis=0)
        tangent = np.gradient(self.centre_line_m.astype(np.float64), axis=0)
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
        normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
        return replace(self, centre_line_m=self.centre_line_m + shift[:, None] * normal, evidence=None)


@dataclass(frozen=True, eq=False)
class Road:
    """The lanes of one site. `source` is "map" (given) or "inferred" (made from tracks)."""

    lanes: tuple[Lane, ...]
    source: str = "map"
    crosswalks_m: tuple[Float[np.ndarray, "_ 2"], ...] = ()

    def __post_init__(self) -> None:
        """Check that lane ids are unique and `source` is known."""
        ids = [lane.lane_id for lane in self.lanes]
        if len(set(ids)) != len(ids):
            raise ValueError("lane_id has duplicates within one road")
        if self.source not in ("map", "inferred"):
            raise ValueError(f"source is 'map' or 'inferred', not {self.source!r}")
        walks = tuple(frozen(c, np.float32, (None, 2), "crosswalks_m") for c in self.crosswalks_m)
        object.__setattr__(self, "crosswalks_m", walks)

    def lane(self, lane_id: str) -> Lane:
        """The lane of that id; KeyError if there is none."""
        for lane in self.lanes:
            if lane.lane_id == lane_id:
                return lane
        raise KeyError(lane_id)
