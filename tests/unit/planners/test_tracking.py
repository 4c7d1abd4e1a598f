"""The wheel follows a path also where its vertices are far apart."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stylesim.planners.bicycle import LENGTH_M, EgoState
from stylesim.planners.tracking import steering_to


def straight(x: float, vertices: int = 2) -> np.ndarray:
    """The x axis from beside the ego on."""
    return np.stack([np.linspace(x, 1200.0, vertices), np.zeros(vertices)], axis=1)


def driven(*, aside_m: float, heading_rad: float, speed_mps: float, seconds: float) -> EgoState:
    """A kinematic bicycle (about its centre, as in highway-env) that steers along the x axis at constant speed."""
    x, y, heading = 0.0, aside_m, heading_rad
    for _ in range(round(seconds / 0.1)):
        steering = steering_to(straight(x), EgoState(x, y, heading, speed_mps))
        slip = math.atan(0.5 * math.tan(steering))
        x += speed_mps * math.cos(heading + slip) * 0.1
        y += speed_mps * math.sin(heading + slip) * 0.1
        heading += speed_mps * math.sin(slip) / (LENGTH_M / 2) * 0.1
    return EgoState(x, y, heading, speed_mps)


@pytest.mark.parametrize("speed_mps", [5.0, 14.0, 30.0])
def test_who_starts_askew_is_back_in_the_lane_after_some_seconds(speed_mps: float) -> None:
    end = driven(aside_m=1.0, heading_rad=-0.05, speed_mps=speed_mps, seconds=6.0)
    assert abs(end.y) < 0.05
    assert abs(end.heading_rad) < 0.01


@given(st.floats(2.0, 30.0), st.floats(-1.5, 1.5), st.floats(-0.2, 0.2))
def test_more_vertices_on_the_same_line_change_nothing(speed_mps: float, aside_m: float, heading_rad: float) -> None:
    state = EgoState(0.0, aside_m, heading_rad, speed_mps)
    assert steering_to(straight(0.0, 606), state) == pytest.approx(steering_to(straight(0.0), state), abs=1e-6)


def test_at_the_end_of_a_path_it_aims_at_the_end() -> None:
    state = EgoState(0.0, 0.0, 0.0, 20.0)
    assert steering_to(np.array([[0.0, 0.0], [4.0, 0.0]]), state) == 0.0
    assert steering_to(np.array([[0.0, 0.0]]), state) == 0.0
    assert steering_to(np.array([[0.0, 0.0], [4.0, 1.0]]), state) > 0.0
