"""Decisions that a future turns on, as gates: who is past a place on its way by a moment has gone, else it has not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64

from stylesim.geometry import project

STOP_OR_GO = "stop or go at the yellow"
FIRST_OR_SECOND = "go first or yield"


@dataclass(frozen=True, eq=False)
class Decision:
    """One driver's decision, asked about at frame `t0`.

    It goes if its centre is `station_m` or more along `path_m` within `steps` frames after t0. `went` is what it did.
    `with_event` says that an unusual event (a stressor) had a part in it.
    """

    kind: str
    agent: int
    t0: int
    path_m: Float64[np.ndarray, "point 2"]
    station_m: float
    steps: int
    went: bool
    with_event: bool = False

    @property
    def taken(self) -> str:
        """What it did, in words."""
        return {
            (STOP_OR_GO, True): "go", (STOP_OR_GO, False): "stop",
            (FIRST_OR_SECOND, True): "first", (FIRST_OR_SECOND, False): "yield",
        }[self.kind, self.went]  # fmt: skip


def goes(decision: Decision, mode_m: Float[np.ndarray, "mode time 2"]) -> Bool[np.ndarray, " mode"]:
    """For each mode, whether it passes the gate in time; its first point is one frame after t0."""
    modes, points = mode_m.shape[0], mode_m[:, : decision.steps]
    along, _, _, _ = project(points.reshape(-1, 2), decision.path_m)
    return np.asarray(along.reshape(modes, -1).max(axis=1) >= decision.station_m)
