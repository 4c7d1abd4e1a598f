"""What a planner is asked and may answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from stylesim.arrays import frozen
from stylesim.scene import Scene

EGO_ID = "ego"


@dataclass(frozen=True)
class EgoControl:
    """Pedal and wheel until the next question; the vehicle's limits are applied to them."""

    acceleration_mps2: float
    steering_rad: float  # of the front wheels, left is positive


@dataclass(frozen=True, eq=False)
class EgoTrajectory:
    """Where the box centre shall be: row i at (i + 1) * dt_s from now, in the frame of the scene's tracks, m."""

    position_m: Float[np.ndarray, "step 2"]
    dt_s: float = 0.1

    def __post_init__(self) -> None:
        """Check the shape, that the numbers are finite and the clock runs, and freeze the array."""
        position = frozen(self.position_m, np.float64, (None, 2), "position_m")
        if not len(position) or not np.isfinite(position).all():
            raise ValueError("a trajectory needs at least one position, and finite numbers")
        if not 0.0 < self.dt_s <= 10.0:
            raise ValueError(f"dt_s of a trajectory must lie in (0, 10], not {self.dt_s}")
        object.__setattr__(self, "position_m", position)


@runtime_checkable
class Planner(Protocol):
    """A function, or an object made without arguments for each episode, that is called every 0.1 s.

    `scene` is what has been seen so far: the frames up to now (at most 2 s of them, fewer at the start), nothing later,
    no style and no outcome. Track 0 is the ego ("ego", with the flag EGO); the last frame is now. Road and lights are
    there where the scenario has them.
    """

    def __call__(self, scene: Scene) -> EgoControl | EgoTrajectory:
        """What the ego does until the next question."""
        ...
