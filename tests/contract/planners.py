"""Planners for the tests: simple, and wrong in every way."""

from __future__ import annotations

from typing import Any

import numpy as np

from stylesim.planners import EgoControl, EgoTrajectory
from stylesim.scene import Scene


def coast(scene: Scene) -> EgoControl:
    """Neither pedal nor wheel."""
    return EgoControl(0.0, 0.0)


def stop(scene: Scene) -> EgoControl:
    """Brakes with 3 m/s2 until it stands, and stays."""
    return EgoControl(-3.0, 0.0)


def straight_trajectory(scene: Scene) -> EgoTrajectory:
    """Three seconds straight on at 10 m/s, as a trajectory."""
    tracks = scene.tracks
    ahead = np.array([np.cos(tracks.heading_rad[0, -1]), np.sin(tracks.heading_rad[0, -1])])
    return EgoTrajectory(tracks.position_m[0, -1] + ahead * np.arange(1, 31)[:, None] * 1.0, 0.1)


def ram(scene: Scene) -> EgoControl:
    """Full pedal, whoever is ahead."""
    return EgoControl(9.0, 0.0)


class Remembers:
    """Keeps what it was shown; made anew for each episode."""

    scenes: list[Scene] = []  # noqa: RUF012 - read by the tests

    def __init__(self) -> None:
        type(self).scenes = []

    def __call__(self, scene: Scene) -> EgoControl:
        type(self).scenes.append(scene)
        return EgoControl(0.0, 0.0)


class FailsLater:
    """Raises in its eleventh step."""

    def __init__(self) -> None:
        self.step = 0

    def __call__(self, scene: Scene) -> EgoControl:
        self.step += 1
        if self.step > 10:
            raise RuntimeError("no plan left")
        return EgoControl(0.0, 0.0)


class NeedsArguments:
    """Cannot be made without arguments."""

    def __init__(self, weights: str) -> None:
        self.weights = weights


class NotCallable:
    """Has no __call__."""


def answers_text(scene: Scene) -> Any:
    """No answer."""
    return "left"


def answers_nan(scene: Scene) -> EgoControl:
    """Not a number."""
    return EgoControl(float("nan"), 0.0)


NUMBER = 3
