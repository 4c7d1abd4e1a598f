"""The foot: exact where the model drives as a car can, bounded where it does not, restless as its style says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.simulation.foot import FREE_M, JUMP_MPS2, SUDDEN, Foot, footed, noise_gain
from stylesim.simulation.stopping import EMERGENCY_MPS2, HARD_JERK_MPS3, HARD_MPS2, JERK_MPS3
from stylesim.simulation.wander import WanderSwitch
from stylesim.styles import style_table

NEUTRAL = style_table().at(0.0)
DT_S = 0.1


def driven(sds: list[float], model: np.ndarray, *, seed: int = 0, switch: WanderSwitch | None = None):
    styles = [replace(NEUTRAL, pedal_noise_mps2=sd) for sd in sds]
    streams = [np.random.default_rng([seed, index]) for index in range(len(sds))]
    return footed(styles, model, dt_s=DT_S, streams=streams, switch=switch)


def harsh(seed: int, drivers: int = 4, frames: int = 400) -> np.ndarray:
    """Speeds that jump between accelerations of -7.5 and 3.5 m/s2 several times a second, down to standing."""
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.uniform(-7.5, 3.5, (drivers, frames // 4)), 4, axis=1) * DT_S
    speed = np.full(drivers, 15.0)
    table = np.empty((drivers, frames))
    for frame in range(frames):
        speed = np.clip(speed + steps[:, frame], 0.0, 35.0)
        table[:, frame] = speed
    return table


def test_a_calm_foot_follows_a_smooth_model_exactly() -> None:
    model = 15.0 + 5.0 * np.cos(np.arange(600) * DT_S / 3.0)[None]
    ahead, speed = driven([0.0], model)
    np.testing.assert_allclose(speed, model, atol=1e-9)
    np.testing.assert_allclose(ahead, 0.0, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), sd=st.sampled_from([0.0, 0.4, 1.0]))
def test_acceleration_and_jerk_are_bounded_whatever_the_model_does(seed: int, sd: float) -> None:
    ahead, speed = driven([sd] * 4, harsh(seed))
    assert (speed >= 0.0).all()
    acceleration = np.diff(speed, axis=1) / DT_S
    assert acceleration.min() >= -EMERGENCY_MPS2 - 1e-9
    assert acceleration.max() <= HARD_MPS2 + 1e-9
    moving = speed[:, 2:] > 0.0  # what is left of the braking ends where the vehicle stands
    jerk = np.where(moving, np.diff(speed, n=2, axis=1) / DT_S**2, 0.0)
    assert np.abs(jerk).max() <= HARD_JERK_MPS3 + 1e-6
    wished = np.diff(harsh(seed), axis=1) / DT_S
    sudden = wished[:, 1:] - acceleration[:, :-1] < -SUDDEN * JERK_MPS3 * DT_S  # of the model, from how one drives
    hard = (wished[:, 1:] < -HARD_MPS2) | (sudden & (wished[:, 1:] < 0.0))
    assert np.abs(np.where(hard, 0.0, jerk)).max() <= JERK_MPS3 + 1e-6
    assert np.isfinite(ahead).all()


def test_a_hard_stop_ends_where_it_was_planned() -> None:
    """7 m/s2 built up with 30 m/s3, as a stop at the yellow that is just possible."""
    wished = np.concatenate([np.zeros(50), -np.minimum(3.0 * np.arange(1, 40), 7.0), np.zeros(40)])
    model = np.maximum(0.0, 20.0 + np.cumsum(wished) * DT_S)[None]
    ahead, speed = driven([0.0], model)
    assert speed[0, -1] == 0.0
    assert np.abs(ahead).max() < 0.2


@pytest.mark.parametrize("braking", [3.5, 4.0, 4.4])
def test_a_restless_foot_ends_a_firm_stop_where_it_was_planned(braking: float) -> None:
    """20 drivers who play with the pedal until they brake; 4.4 m/s2 leave little to the limit of 4.5."""
    wished = np.concatenate([np.zeros(80), -np.minimum(1.2 * np.arange(1, 80), braking), np.zeros(20)])
    model = np.maximum(0.0, 18.0 + np.cumsum(wished) * DT_S)[None].repeat(20, axis=0)
    ahead, speed = driven([0.8] * 20, model)
    assert (speed[:, -1] < 0.01).all()
    assert np.abs(ahead[:, -1]).max() < 0.5


def test_it_stops_where_the_model_stops() -> None:
    """Braking with 3 m/s2 to a stand, which ends from one step to the next."""
    model = np.maximum(0.0, 15.0 - 3.0 * DT_S * np.arange(200))[None]
    ahead, speed = driven([0.5], model)
    assert speed[0, -1] == 0.0
    assert abs(ahead[0, -1]) < 0.3


def test_the_noise_has_the_sd_of_the_style_and_stays_close() -> None:
    ahead, speed = driven([0.2, 0.7], np.full((2, 30_000), 20.0))
    np.testing.assert_allclose(np.diff(speed, axis=1).std(axis=1) / DT_S, [0.2, 0.7], rtol=0.05)
    assert np.abs(ahead).max() < FREE_M + 0.5
    assert np.abs(ahead.mean(axis=1)).max() < 0.02
    jerk = np.abs(np.diff(speed[1], n=2)) / DT_S**2
    assert np.percentile(jerk, 99.9) < 12.0


def test_who_stands_is_not_restless() -> None:
    _, speed = driven([1.0], np.zeros((1, 300)))
    assert (speed == 0.0).all()


def test_another_driver_or_a_longer_episode_shifts_nobody() -> None:
    model = harsh(7, drivers=3)
    ahead, speed = driven([0.2, 0.5, 0.9], model)
    fewer, slower = driven([0.2, 0.5], model[:2, :200])
    np.testing.assert_array_equal(ahead[:2, :200], fewer)
    np.testing.assert_array_equal(speed[:2, :200], slower)


def test_a_switch_leaves_the_past_alone() -> None:
    model = np.full((2, 300), 20.0)
    plain, _ = driven([0.3, 0.3], model)
    bolder = WanderSwitch(1, 100, replace(NEUTRAL, pedal_noise_mps2=0.9))
    null = WanderSwitch(1, 100, replace(NEUTRAL, pedal_noise_mps2=0.3), np.random.default_rng(99))
    for switch in (bolder, null):
        other, _ = driven([0.3, 0.3], model, switch=switch)
        np.testing.assert_array_equal(other[0], plain[0])
        np.testing.assert_array_equal(other[1, :100], plain[1, :100])
        assert np.abs(other[1, 100:] - plain[1, 100:]).max() > 0.05


def test_who_was_put_elsewhere_begins_anew() -> None:
    model = np.full((1, 60), 20.0)
    model[0, 30:] = 20.0 - 2 * JUMP_MPS2 * DT_S
    ahead, speed = driven([0.0], model)
    assert speed[0, 30] == model[0, 30]
    assert ahead[0, 30] == 0.0


def test_lengths_must_agree() -> None:
    with pytest.raises(ValueError, match="styles"):
        footed([NEUTRAL], np.ones((2, 5)), dt_s=DT_S, streams=[np.random.default_rng(0)] * 2)


def test_the_gain_depends_on_the_correlation_time_only() -> None:
    assert noise_gain(0.8, DT_S) > 0.0
    assert noise_gain(0.4, DT_S) < noise_gain(0.8, DT_S)
    foot = Foot([NEUTRAL], dt_s=DT_S)
    ahead, speed = foot.advance(slice(None), np.array([12.0]), np.array([0.0]))
    assert (ahead[0], speed[0]) == (0.0, 12.0)
