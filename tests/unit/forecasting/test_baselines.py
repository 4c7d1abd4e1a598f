from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.forecast import Forecaster, ForecastTask
from stylesim.forecasting.baselines import ConstantTurnRate, ConstantVelocity
from stylesim.scene import Scene
from stylesim.tracks import Tracks


def circling(rate_radps: float, speed_mps: float = 10.0, frames: int = 90) -> Scene:
    """One car on a circle (a straight line at rate 0)."""
    t = np.arange(frames) * 0.1
    heading = 0.3 + rate_radps * t
    velocity = speed_mps * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    if rate_radps:
        position = speed_mps / rate_radps * np.stack([np.sin(heading), -np.cos(heading)], axis=-1)
    else:
        position = velocity * t[:, None]
    tracks = Tracks(
        agent_id=("a",),
        kind=np.ones(1, np.int8),
        size_m=np.array([[4.5, 1.8]]),
        position_m=position[None],
        velocity_mps=velocity[None],
        heading_rad=(np.remainder(heading + np.pi, 2 * np.pi) - np.pi)[None],
        valid=np.ones((1, frames), bool),
        dt_s=0.1,
    )
    return Scene("circle", "circle", "made", "circle", tracks)


def ask(scene: Scene, t0: int = 49) -> ForecastTask:
    return ForecastTask(scene.history(t0, 50), np.array([0]), 40, t0)


def test_constant_velocity_is_exact_on_a_straight_line() -> None:
    scene = circling(0.0)
    forecast = ConstantVelocity().predict([ask(scene)])[0]
    np.testing.assert_allclose(forecast.mode_m[0, 0], scene.tracks.position_m[0, 50:90], atol=1e-3)
    np.testing.assert_array_equal(forecast.probability, [[1.0]])


@pytest.mark.parametrize("rate", [0.0, 0.2, -0.5])
def test_constant_turn_rate_is_exact_on_a_circle(rate: float) -> None:
    scene = circling(rate)
    forecast = ConstantTurnRate().predict([ask(scene)])[0]
    np.testing.assert_allclose(forecast.mode_m[0, 0], scene.tracks.position_m[0, 50:90], atol=5e-3)


def test_constant_velocity_misses_a_turn() -> None:
    scene = circling(0.5)
    error = ConstantVelocity().predict([ask(scene)])[0].mode_m[0, 0, -1] - scene.tracks.position_m[0, 89]
    assert np.hypot(*error) > 10.0


def test_a_turning_sensor_on_a_standing_car_is_no_turn() -> None:
    scene = circling(0.5, speed_mps=0.5)
    straight, arc = (model.predict([ask(scene)])[0].mode_m for model in (ConstantVelocity(), ConstantTurnRate()))
    np.testing.assert_allclose(arc, straight, atol=1e-5)


@pytest.mark.parametrize("model", [ConstantVelocity(), ConstantTurnRate()])
def test_an_agent_unknown_at_t0_is_refused_by_name(model: Forecaster) -> None:
    scene = circling(0.0)
    valid = scene.tracks.valid.copy()
    valid[:, 49] = False
    with pytest.raises(InputError, match="'a' is not known at t0"):
        model.predict([ask(replace(scene, tracks=replace(scene.tracks, valid=valid)))])
