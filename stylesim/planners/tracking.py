"""From a trajectory to pedal and wheel: the steering that leads to a point ahead, the pedal that is there in time."""

from __future__ import annotations

import math

import numpy as np

from stylesim.planners.answers import EgoControl, EgoTrajectory
from stylesim.planners.bicycle import LENGTH_M, EgoState

LOOK_AHEAD_S = 0.5  # chosen, because a shorter one swings and a longer one cuts corners
LEAST_AHEAD_M = 3.0
PEDAL_S = 0.5  # the time in which the trajectory's place shall be reached; chosen, because it is about a reaction


def control_towards(trajectory: EgoTrajectory, state: EgoState) -> EgoControl:
    """Pure pursuit on the trajectory's path, and the acceleration that brings the ego to its place after 0.5 s.

    Pure pursuit (Coulter 1992 [recalled]): curvature = 2 sin(angle to the point) / distance; here about the centre.
    """
    points = np.vstack([[state.x, state.y], trajectory.position_m])
    times = np.arange(len(points)) * trajectory.dt_s
    horizon = min(PEDAL_S, float(times[-1]))
    goal = np.array([np.interp(horizon, times, points[:, axis]) for axis in (0, 1)])
    ahead = math.cos(state.heading_rad) * (goal[0] - state.x) + math.sin(state.heading_rad) * (goal[1] - state.y)
    pedal = 2.0 * (float(ahead) - state.speed_mps * horizon) / horizon**2
    return EgoControl(pedal, steering_to(points, state))


def steering_to(path_m: np.ndarray, state: EgoState) -> float:
    """The steering angle that leads to the point of a path at the look-ahead distance; 0 for a path without length."""
    reach = max(LEAST_AHEAD_M, LOOK_AHEAD_S * state.speed_mps)
    away = np.hypot(path_m[:, 0] - state.x, path_m[:, 1] - state.y)
    beyond = np.flatnonzero(away >= reach)
    number = int(beyond[0]) if len(beyond) else int(np.argmax(away))
    distance = float(away[number])
    if distance < 0.1:
        return 0.0
    angle = math.atan2(path_m[number, 1] - state.y, path_m[number, 0] - state.x) - state.heading_rad
    curvature = 2.0 * math.sin(math.remainder(angle, 2.0 * math.pi)) / distance
    slip = math.asin(min(max(curvature * LENGTH_M / 2.0, -0.9), 0.9))
    return math.atan(2.0 * math.tan(slip))
