"""Do the numbers of a whole recording fit one another? Feet, pixels, km/h and degrees are refused, not read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stylesim.datasets.dense import CAR_LENGTH_M, MAX_HEADING_ERROR_RAD, MIN_CARS
from stylesim.datasets.plausible import MAX_SPEED_MPS, MIN_ROWS, MOVING_MPS, SPEED_RATIO
from stylesim.datasets.recording import Recording
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.tracks import MOTOR_KINDS, AgentKind


def refuse_other_units(recording: Recording, file: Path) -> None:
    """InputError naming `file` where sizes, speeds or headings cannot be in metres, m/s and radians as a whole."""
    cars = recording.size_m[recording.kind == AgentKind.CAR, 0]
    if len(cars) >= MIN_CARS and not CAR_LENGTH_M[0] <= np.median(cars) <= CAR_LENGTH_M[1]:
        raise InputError(f"{file}: half of the cars are {np.median(cars):.2f} m long or longer; lengths must be metres")
    joined = (np.diff(recording.agent) == 0) & (np.diff(recording.frame) == 1)
    joined &= np.isin(recording.kind, [int(k) for k in MOTOR_KINDS])[recording.agent[1:]]
    step = np.diff(recording.position_m, axis=0) / recording.dt_s
    moved = np.hypot(step[:, 0], step[:, 1])
    speed = np.hypot(recording.velocity_mps[:, 0], recording.velocity_mps[:, 1])
    meant = (speed[1:] + speed[:-1]) / 2
    moving = joined & ((meant > MOVING_MPS) | (moved > MOVING_MPS))
    if moving.sum() < MIN_ROWS:
        return
    fastest = float(np.median(moved[moving]))
    if fastest > MAX_SPEED_MPS:
        raise InputError(f"{file}: half of what moves is faster than {fastest:.0f} m/s; are positions pixels or feet?")
    ratio = float(np.median(moved[moving] / np.maximum(meant[moving], 1e-3)))
    if not SPEED_RATIO[0] <= ratio <= SPEED_RATIO[1]:
        raise InputError(
            f"{file}: positions move {ratio:.2f} times as fast as the velocities say; "
            f"positions must be metres, {recording.dt_s:g} s apart, and velocities m/s"
        )
    course = np.arctan2(step[:, 1], step[:, 0])[moving]
    error = float(np.median(np.abs(wrap_angle(course - recording.heading_rad[1:][moving]))))
    if error > MAX_HEADING_ERROR_RAD:
        raise InputError(
            f"{file}: headings are {np.degrees(error):.0f} degrees off the direction of motion; "
            "they must be counter-clockwise from east"
        )
