"""`EgoDriver`: asks a planner step by step, checks its answers, and knows when the ego has crashed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from stylesim.errors import SimulationError
from stylesim.geometry import box_corners, boxes_overlap
from stylesim.planners.answers import EgoControl, EgoTrajectory
from stylesim.planners.bicycle import MAX_BRAKING_MPS2, EgoState, limited
from stylesim.planners.loading import load_planner
from stylesim.planners.seen import Frame, Memory, Place

STOP = EgoControl(-MAX_BRAKING_MPS2, 0.0)


class EgoDriver:
    """The planner of one episode in its vehicle; `counts` says what the scene should say of it."""

    def __init__(self, entry_point: str, place: Place) -> None:
        self._name = entry_point
        self._planner: Callable[..., Any] = load_planner(entry_point)()
        self._memory = Memory(place)
        self._dt_s = place.dt_s
        self._asked = 0
        self.hit: set[str] = set()  # whom the ego has collided with
        self._limited = 0

    @property
    def counts(self) -> dict[str, int]:
        """How often the planner was asked, how often the vehicle's limits cut its answer, with how many it collided."""
        return {"ego_steps": self._asked, "ego_steps_limited": self._limited, "ego_collisions": len(self.hit)}

    def drive(self, frame: Frame, state: EgoState) -> EgoControl:
        """The control for the coming step, within the vehicle's limits; a crashed ego brakes and is not asked any more.

        SimulationError with the planner's name, the step and the time where it raises or answers what is no answer.
        """
        self._memory.add(frame)
        self.hit |= touched(frame)
        if self.hit:
            return limited(STOP, state, dt_s=self._dt_s).control
        try:
            answer = self._planner(self._memory.scene())
        except Exception as error:  # whatever the user's planner raises
            raise SimulationError(f"{self._where()}: {type(error).__name__}: {error}") from error
        self._asked += 1
        wish = self._checked(answer, state)
        result = limited(wish, state, dt_s=self._dt_s)
        self._limited += result.cut
        return result.control

    def _checked(self, answer: Any, state: EgoState) -> EgoControl:
        from stylesim.planners.tracking import control_towards

        control = control_towards(answer, state) if isinstance(answer, EgoTrajectory) else answer
        if not isinstance(control, EgoControl):
            kind = type(answer).__name__
            raise SimulationError(f"{self._where()}: it answered a {kind}, not an EgoControl or EgoTrajectory")
        numbers = (control.acceleration_mps2, control.steering_rad)
        if not all(isinstance(x, int | float | np.number) and math.isfinite(x) for x in numbers):
            raise SimulationError(f"{self._where()}: it answered {control}, which are not finite numbers")
        return EgoControl(float(control.acceleration_mps2), float(control.steering_rad))

    def _where(self) -> str:
        return f"planner {self._name!r} at step {self._asked} ({self._asked * self._dt_s:.1f} s)"


def touched(frame: Frame) -> set[str]:
    """Whose boxes overlap the ego's in this frame."""
    away = np.hypot(*(frame.pose[1:, :2] - frame.pose[0, :2]).T)
    reach = (np.hypot(*frame.size_m[1:].T) + np.hypot(*frame.size_m[0])) / 2
    near = np.flatnonzero(away < reach) + 1
    if not len(near):
        return set()
    mine = np.repeat(box_corners(frame.pose[:1, :2], frame.pose[:1, 4], frame.size_m[:1]), len(near), axis=0)
    theirs = box_corners(frame.pose[near, :2], frame.pose[near, 4], frame.size_m[near])
    return {frame.agent_id[i] for i in near[boxes_overlap(mine, theirs)]}
