"""The yellow decision, brake response, deceleration and pedal noise."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stylesim.simulation.driving import (
    HARDEST_BRAKING_MPS2,
    SHORTEST_RESPONSE_S,
    brake_response,
    decide_at_yellow,
    needed_deceleration,
    pedal_noise,
    stop_probability,
    wished_deceleration,
)
from stylesim.styles import style_table

NEUTRAL = style_table().at(0.0)


def test_neutral_driver_is_the_published_one() -> None:
    assert (NEUTRAL.yellow_slope_per_s, NEUTRAL.yellow_midpoint_s) == (2.14, 2.88)
    law = {"midpoint_s": NEUTRAL.yellow_midpoint_s, "slope_per_s": NEUTRAL.yellow_slope_per_s}
    assert stop_probability(2.88, **law) == pytest.approx(0.5)
    assert stop_probability(1.85, **law) == pytest.approx(0.10, abs=0.005)  # the dilemma zone: 10 % to 90 %
    assert stop_probability(3.9, **law) == pytest.approx(0.90, abs=0.005)
    assert stop_probability(math.inf, **law) == 1.0


@given(a=st.floats(0.0, 30.0), b=st.floats(0.0, 30.0), m=st.floats(1.5, 5.0), k=st.floats(0.5, 4.0))
def test_stopping_is_likelier_the_more_time_is_left(a: float, b: float, m: float, k: float) -> None:
    near, far = sorted((a, b))
    assert stop_probability(near, midpoint_s=m, slope_per_s=k) <= stop_probability(far, midpoint_s=m, slope_per_s=k)


def test_decisions_follow_the_law() -> None:
    speed, drawn = 16.0, 1500
    for time_s in (2.3, 2.88, 3.6):
        rng = np.random.default_rng(1)
        stops = [
            decide_at_yellow(NEUTRAL, speed_mps=speed, distance_m=speed * time_s, rng=rng).stop for _ in range(drawn)
        ]
        wanted = stop_probability(time_s, midpoint_s=2.88, slope_per_s=2.14)
        assert np.mean(stops) == pytest.approx(wanted, abs=4 * math.sqrt(0.25 / drawn))


@given(speed=st.floats(0.1, 30.0), distance=st.floats(0.0, 250.0), seed=st.integers(0, 2**32))
def test_who_stops_can_stop(speed: float, distance: float, seed: int) -> None:
    decision = decide_at_yellow(NEUTRAL, speed_mps=speed, distance_m=distance, rng=np.random.default_rng(seed))
    if not decision.stop:
        assert math.isnan(decision.deceleration_mps2)
        return
    assert decision.response_s >= SHORTEST_RESPONSE_S
    needed = needed_deceleration(speed_mps=speed, distance_m=distance, response_s=decision.response_s)
    assert needed <= HARDEST_BRAKING_MPS2 * (1 + 1e-9)


def test_a_standing_driver_stays() -> None:
    assert decide_at_yellow(NEUTRAL, speed_mps=0.0, distance_m=3.0, rng=np.random.default_rng(0)).stop


def test_the_number_of_draws_does_not_depend_on_the_answer() -> None:
    one, other = np.random.default_rng(5), np.random.default_rng(5)
    decide_at_yellow(NEUTRAL, speed_mps=15.0, distance_m=200.0, rng=one)
    decide_at_yellow(NEUTRAL, speed_mps=15.0, distance_m=5.0, rng=other)
    assert one.random() == other.random()


def test_response_and_deceleration_have_gates_quantiles() -> None:
    rng = np.random.default_rng(2)
    people = [replace(style_table().at(0.0, rng)) for _ in range(1500)]
    response = np.quantile([brake_response(person, rng) for person in people], [0.15, 0.5, 0.85])
    braking = np.quantile([wished_deceleration(person, rng) for person in people], [0.15, 0.5, 0.85])
    np.testing.assert_allclose(response, [0.7, 1.0, 1.6], atol=0.15)
    np.testing.assert_allclose(braking, [2.2, 3.0, 3.9], atol=0.4)  # neutral comfortable 2.8 m/s2


def test_pedal_noise_has_its_sd_and_correlation_time() -> None:
    style = replace(NEUTRAL, pedal_noise_mps2=0.8, pedal_noise_time_s=0.8)
    noise = pedal_noise(style, n_frames=60_000, dt_s=0.1, rng=np.random.default_rng(3))
    assert noise.std() == pytest.approx(0.8, rel=0.05)
    assert np.corrcoef(noise[:-8], noise[8:])[0, 1] == pytest.approx(math.exp(-1.0), abs=0.05)
