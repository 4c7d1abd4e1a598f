"""The average over styles, and the posterior that weighs them."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch

from stylesim.errors import InputError
from stylesim.forecast import Forecast
from stylesim.forecasting.conditioner import StyleConditioner
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.marginal import MARGINAL, AsStyle, averaged
from stylesim.forecasting.measured import Measured
from stylesim.forecasting.posterior import StylePosterior
from tests.conftest import make_scene

from .made import SpeedJudges, conditioner, task_of, untrained

CLASSES = ("a", "b", "c")


def shown(rng: np.random.Generator, drivers: int = 600) -> tuple[Measured, np.ndarray]:
    """Drivers whose one feature that tells the class lies 2 apart, with unit noise; nobody is "b"."""
    target = rng.choice([0, 2], drivers, p=[0.3, 0.7])
    evidence = np.column_stack([target + rng.normal(size=drivers), rng.normal(size=drivers)])
    evidence = np.expm1(np.abs(evidence)) * np.sign(evidence)  # the posterior takes logarithms
    rows = np.zeros(drivers, np.int64)
    return Measured(rows - 1, np.zeros((drivers, 4)), rows, np.zeros((drivers, 0)), evidence), target


def fitted() -> StylePosterior:
    measured, target = shown(np.random.default_rng(0), 4000)
    found = StylePosterior.fit(measured, target, CLASSES, rng=np.random.default_rng(0))
    assert found is not None
    return found


def test_the_posterior_is_calibrated_on_drivers_it_has_not_seen() -> None:
    measured, target = shown(np.random.default_rng(1), 4000)
    chance = fitted().of(measured)
    np.testing.assert_allclose(chance.sum(axis=1), 1.0)
    assert (chance[:, 1] == 0).all()
    for low, high in ((0.0, 0.2), (0.4, 0.6), (0.8, 1.0)):
        rows = (chance[:, 2] >= low) & (chance[:, 2] <= high)
        assert abs((target[rows] == 2).mean() - chance[rows, 2].mean()) < 0.06
    assert ((chance.argmax(axis=1) == target).mean()) > 0.8


def test_who_shows_nothing_gets_the_frequencies() -> None:
    blank = np.full((1, 4), np.nan), np.array([0]), np.zeros((1, 0)), np.full((1, 2), np.nan)
    nothing = Measured(np.array([-1]), *blank)
    posterior = fitted()
    np.testing.assert_allclose(posterior.of(nothing)[0], posterior.frequency)
    assert 0.2 < posterior.frequency[0] < 0.4


def test_it_comes_back_from_json_bit_for_bit() -> None:
    posterior = fitted()
    back = StylePosterior.from_dict(json.loads(json.dumps(posterior.to_dict())))
    measured, _ = shown(np.random.default_rng(2))
    assert back.of(measured).tobytes() == posterior.of(measured).tobytes()


def test_nothing_to_learn_from_is_no_posterior() -> None:
    measured, target = shown(np.random.default_rng(0))
    rng = np.random.default_rng(0)
    assert StylePosterior.fit(measured, np.full_like(target, -1), CLASSES, rng=rng) is None
    blank = Measured(measured.style, measured.feature, measured.highway)
    assert StylePosterior.fit(blank, target, CLASSES, rng=rng) is None


def fan(end_x: list[float], chance: list[float]) -> Forecast:
    path = np.zeros((1, len(end_x), 5, 2), np.float32)
    path[0, :, :, 0] = np.linspace(0.2, 1.0, 5)[None] * np.array(end_x)[:, None]
    return Forecast(path, np.array([chance], np.float32))


def test_modes_of_all_styles_are_weighed_and_merged_where_they_agree() -> None:
    brakes, drives = fan([0.0, 10.0], [0.9, 0.1]), fan([50.0, 10.5], [0.6, 0.4])
    both = averaged([brakes, drives], np.array([[0.75, 0.25]]), count=3, apart_m=2.5)
    ends = both.mode_m[0, :, -1, 0]
    assert ends.tolist() == [0.0, 10.5, 50.0]
    end, weight = np.array([0.0, 10.0, 50.0, 10.5]), np.array([0.675, 0.075, 0.15, 0.1])  # of the mixture
    width = (np.abs(end - 0.0) * weight).sum()  # what the best single answer is expected to be wrong
    density = [(np.exp(-0.5 * ((end - kept) / width) ** 2) * weight).sum() for kept in ends]
    np.testing.assert_allclose(both.probability[0], np.array(density) / np.sum(density), atol=1e-6)


def test_a_style_of_probability_zero_plays_no_part() -> None:
    one, other = fan([0.0, 10.0], [0.9, 0.1]), fan([50.0, 60.0], [0.6, 0.4])
    both = averaged([one, other], np.array([[1.0, 0.0]]), count=2, apart_m=2.5)
    assert both.mode_m[0, :, -1, 0].tolist() == [0.0, 10.0]
    np.testing.assert_allclose(both.probability[0], [0.9, 0.1], atol=1e-6)


def with_posterior() -> TrainedForecaster:
    class Evident(SpeedJudges):
        def measure(self, history, agent_index):  # type: ignore[no-untyped-def]
            seen = super().measure(history, agent_index)
            return Measured(seen.style, seen.feature, seen.highway, seen.score, seen.feature)

    rng = np.random.default_rng(0)
    evidence = rng.uniform(0, 15, (400, 4))
    measured = Measured(np.zeros(400, np.int64), evidence, np.zeros(400, np.int64), np.zeros((400, 0)), evidence)
    posterior = StylePosterior.fit(measured, (evidence[:, 1] < 11).astype(np.int64), ("fast", "slow"), rng=rng)
    model = untrained(styled=True)
    assert model.network.style is not None
    torch.nn.init.normal_(model.network.style.u, std=2.0)  # type: ignore[arg-type]
    cells = conditioner().cells
    return TrainedForecaster("made", model.network, StyleConditioner("tdbm", Evident(), cells, posterior))


def test_a_forecaster_averages_over_what_it_would_say_for_every_style() -> None:
    model = with_posterior()
    task = task_of(make_scene(seed=3), 40)
    marginal, fast, slow = (model.predict([task], style)[0] for style in (MARGINAL, "fast", "slow"))
    np.testing.assert_allclose(marginal.probability.sum(axis=1), 1.0, atol=1e-5)
    for driver in range(len(task.agent_index)):
        allowed = {path.tobytes() for one in (fast, slow) for path in one.mode_m[driver]}
        assert {path.tobytes() for path in marginal.mode_m[driver]} <= allowed
    assert marginal.mode_m.tobytes() != fast.mode_m.tobytes()
    assert marginal.mode_m.tobytes() != slow.mode_m.tobytes()


def test_a_forecaster_that_is_always_asked_alike() -> None:
    model = with_posterior()
    task = task_of(make_scene(seed=3), 40)
    slow = AsStyle(model, "slow")
    assert slow.name == "made@slow"
    assert slow.horizon_s == model.horizon_s
    assert slow.predict([task])[0].mode_m.tobytes() == model.predict([task], "slow")[0].mode_m.tobytes()
    with pytest.raises(InputError, match="Did you mean"):
        AsStyle(model, "slo")


def test_without_a_posterior_there_is_no_average() -> None:
    with pytest.raises(InputError, match="no posterior"):
        untrained(styled=True).predict([task_of(make_scene(seed=3), 40)], MARGINAL)
    with pytest.raises(InputError, match="trained without style"):
        untrained().predict([task_of(make_scene(seed=3), 40)], MARGINAL)
