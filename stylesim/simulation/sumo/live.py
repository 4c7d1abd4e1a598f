"""Where SUMO's vehicles are while it runs: boxes in our frame, step by step."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np
from jaxtyping import Float64


def poses_of(sumo: Any, names: list[str], size_m: Float64[np.ndarray, "vehicle 2"]) -> Float64[np.ndarray, "vehicle 7"]:
    """x, y, vx, vy, heading, length, width: SUMO's front bumpers and compass angles turned into ours."""
    vehicle, n = sumo.vehicle, len(names)
    pose = np.empty((n, 7))
    front = np.fromiter(chain.from_iterable(map(vehicle.getPosition, names)), np.float64, 2 * n).reshape(n, 2)
    heading = np.pi / 2 - np.radians(np.fromiter(map(vehicle.getAngle, names), np.float64, n))
    speed = np.fromiter(map(vehicle.getSpeed, names), np.float64, n)
    cos, sin, half = np.cos(heading), np.sin(heading), size_m[:, 0] / 2
    pose[:, 0] = front[:, 0] - cos * half
    pose[:, 1] = front[:, 1] - sin * half
    pose[:, 2] = speed * cos
    pose[:, 3] = speed * sin
    pose[:, 4] = np.remainder(heading + np.pi, 2 * np.pi) - np.pi
    pose[:, 5:] = size_m
    return pose


def driven(
    poses: Float64[np.ndarray, "vehicle 7"],
    ahead_m: Float64[np.ndarray, " vehicle"],
    speed_mps: Float64[np.ndarray, " vehicle"],
) -> Float64[np.ndarray, "vehicle 7"]:
    """The poses moved ahead, with another speed."""
    cos, sin = np.cos(poses[:, 4]), np.sin(poses[:, 4])
    moved = poses.copy()
    moved[:, 0] += ahead_m * cos
    moved[:, 1] += ahead_m * sin
    moved[:, 2] = speed_mps * cos
    moved[:, 3] = speed_mps * sin
    return moved


def shifted(
    poses: Float64[np.ndarray, "vehicle 7"],
    offset_m: Float64[np.ndarray, " vehicle"],
    rate_mps: Float64[np.ndarray, " vehicle"],
) -> Float64[np.ndarray, "vehicle 7"]:
    """The poses moved to the left, with the lateral speed in their velocity and heading."""
    left_x, left_y = -np.sin(poses[:, 4]), np.cos(poses[:, 4])
    speed = np.hypot(poses[:, 2], poses[:, 3])
    moved = poses.copy()
    moved[:, 0] += offset_m * left_x
    moved[:, 1] += offset_m * left_y
    moved[:, 2] += rate_mps * left_x
    moved[:, 3] += rate_mps * left_y
    moved[:, 4] += np.arctan2(rate_mps, np.maximum(speed, 1e-3))
    return moved
