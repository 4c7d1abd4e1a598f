from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.forecasting.arrays import FOOT_M, ArrayForecaster
from stylesim.forecasting.baselines import ConstantVelocity
from tests.conftest import make_scene
from tests.contract.test_forecaster import asked, constant_velocity_in_feet


def made(model: Any, **changes: Any) -> ArrayForecaster:
    return ArrayForecaster("m", model, **{"dt_s": 0.5, "history_s": 2.0, "future_s": 4.0, **changes})


def test_feet_and_two_hertz_give_the_same_as_metres_and_ten() -> None:
    task = asked(make_scene(n_agents=6))
    foreign = made(constant_velocity_in_feet, unit_m=FOOT_M).predict([task])[0]
    ours = ConstantVelocity().predict([task])[0]
    np.testing.assert_allclose(foreign.mode_m, ours.mode_m, atol=0.02)


def test_what_the_model_is_given() -> None:
    seen: dict[str, np.ndarray] = {}

    def model(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
        seen.update(arrays)
        return np.zeros((len(arrays["agent"]), 3, 8, 2))

    task = asked(make_scene(n_agents=6))
    made(model, unit_m=FOOT_M, agents=4, polylines=8).predict([task])
    n = len(task.agent_index)
    assert seen["agent"].shape == (n, 4, 4, 7)
    assert seen["piece"].shape == (n, 8, 10, 2)
    np.testing.assert_allclose(seen["agent"][:, 0, -1, :2], 0.0, atol=1e-3)  # the driver is the origin
    np.testing.assert_allclose(seen["agent_attribute"][:, 0, 0] * FOOT_M, 4.5, rtol=1e-5)
    lane = seen["piece_valid"]
    np.testing.assert_allclose(seen["piece_attribute"][..., 0][lane] * FOOT_M, 3.5, rtol=1e-5)
    made(model, road=False).predict([task])
    assert not seen["piece_valid"].any()


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda n: np.zeros((n + 1, 1, 8, 2)), "expected modes of shape"),
        (lambda n: np.zeros((n, 1, 8, 3)), "expected modes of shape"),
        (lambda n: np.zeros((n, 1, 7, 2)), "7 steps, not 8"),
        (lambda n: np.full((n, 1, 8, 2), np.nan), "NaN"),
        (lambda n: np.full((n, 1, 8, 2), 6e5), "frame or unit"),
        (lambda n: (np.zeros((n, 2, 8, 2)), np.zeros((n, 3))), "expected probabilities"),
        (lambda n: (np.zeros((n, 2, 8, 2)), np.full((n, 2), -1.0)), "softmax"),
    ],
)
def test_a_wrong_answer_is_named(answer: Any, words: str) -> None:
    task = asked(make_scene(n_agents=6))
    with pytest.raises(InputError, match=words):
        made(lambda arrays: answer(len(arrays["agent"]))).predict([task])


@pytest.mark.parametrize("name", ["dt_s", "history_s", "future_s", "unit_m"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_lengths_and_rates_are_positive(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        made(constant_velocity_in_feet, **{name: value})


def untrained(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    raise AssertionError("examples ask the model nothing")


@pytest.mark.parametrize("unit_m", [1.0, FOOT_M])
def test_examples_are_what_the_model_will_be_asked(unit_m: float) -> None:
    """A model that says what the examples say is right at every step of its own, in the scene's frame and metres."""
    scene = make_scene(n_agents=6, n_frames=140)
    examples = list(made(untrained, unit_m=unit_m).examples([scene], stride_s=2.0))
    assert len(examples) == 5  # t0 = 1.9 s, 3.9 s, ..., 9.9 s of 14 s with 4 s ahead
    inputs, future = examples[2]
    knowing = made(lambda arrays: future, unit_m=unit_m)
    task = asked(scene, t0=59, future_steps=40)
    forecast = knowing.predict([task])[0]
    truth = scene.tracks.position_m[task.agent_index, 64:100:5]
    np.testing.assert_allclose(forecast.mode_m[:, 0, 4::5], truth, atol=2e-3)
    assert inputs["agent"].shape[:3] == (len(task.agent_index), 16, 4)
    np.testing.assert_allclose(inputs["agent"][:, 0, -1, :2], 0.0, atol=1e-3)
    assert list(made(untrained).examples([make_scene(n_frames=50)])) == []
