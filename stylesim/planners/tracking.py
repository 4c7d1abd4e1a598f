"""From a trajectory to pedal and wheel: the steering that leads to a point ahead, the pedal that is there in time."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

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


def steering_to(path_m: Float64[np.ndarray, "point 2"], state: EgoState) -> float:
    """The steering angle that leads to the point of a path at the look-ahead distance; 0 for a path without length.

    The path begins beside the ego and leads on from there.
    """
    goal = _ahead(path_m, state, max(LEAST_AHEAD_M, LOOK_AHEAD_S * state.speed_mps))
    distance = float(np.hypot(*goal))
    if distance < 0.1:
        return 0.0
    angle = math.atan2(goal[1], goal[0]) - state.heading_rad
    curvature = 2.0 * math.sin(math.remainder(angle, 2.0 * math.pi)) / distance
    slip = math.asin(min(max(curvature * LENGTH_M / 2.0, -0.9), 0.9))
    return math.atan(2.0 * math.tan(slip))


def _ahead(path_m: Float64[np.ndarray, "point 2"], state: EgoState, reach_m: float) -> Float64[np.ndarray, " 2"]:
    """Where the path leaves the circle of that radius about the ego, seen from it; its farthest point if it does not.

    Between the vertices, too: on a straight road the next one may be hundreds of metres away, and who aims at it
    comes back to his lane so slowly that he drifts into another one.
    """
    seen = path_m - (state.x, state.y)
    away = np.hypot(*seen.T)
    beyond = np.flatnonzero(away >= reach_m)
    if not len(beyond):
        return np.asarray(seen[np.argmax(away)])
    number = int(beyond[0])
    if number == 0:
        return np.asarray(seen[0])
    start, piece = seen[number - 1], seen[number] - seen[number - 1]
    # |start + share * piece| = reach_m has one root in [0, 1]: the piece begins inside of the circle and ends outside.
    a, b, c = piece @ piece, start @ piece, start @ start - reach_m**2
    return np.asarray(start + (math.sqrt(b * b - a * c) - b) / a * piece)
