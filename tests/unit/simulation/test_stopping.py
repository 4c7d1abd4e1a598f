"""Braking to a stop line: before the line, within the limits, as late as one likes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stylesim.simulation.driving import HARDEST_BRAKING_MPS2, SHORTEST_RESPONSE_S
from stylesim.simulation.stopping import EMERGENCY_MPS2, HARD_JERK_MPS3, StopPlan, latest_response_s

DT_S = 0.1


def driven(speed: float, distance: float, response: float, wish: float) -> tuple[np.ndarray, StopPlan]:
    """Speeds until it stands (or a minute is over), and the plan in the end."""
    plan = StopPlan(distance, response, wish, EMERGENCY_MPS2, speed_mps=speed)
    speeds = [speed]
    while speeds[-1] > 0.0 and len(speeds) < 600:
        after = plan.next_speed(speeds[-1], DT_S)
        speeds.append(speeds[-1] if after is None else after)
        plan.moved(speeds[-1], DT_S)
    return np.array(speeds), plan


@given(speed=st.floats(3.0, 30.0), share=st.floats(0.0, 1.0), response=st.floats(0.4, 2.5), wish=st.floats(1.5, 7.5))
def test_who_is_not_too_late_stands_before_the_line_within_the_limits(
    speed: float, share: float, response: float, wish: float
) -> None:
    nearest = speed * SHORTEST_RESPONSE_S + speed**2 / 15.0 + speed * 0.125 + 1.1
    distance = nearest + share * 6.0 * speed
    latest = latest_response_s(speed_mps=speed, distance_m=distance, deceleration_mps2=HARDEST_BRAKING_MPS2)
    speeds, plan = driven(speed, distance, min(response, max(latest, 0.0)), wish)
    assert speeds[-1] == 0.0
    assert plan.distance_m > 0.0
    assert plan.distance_m < 2.0
    change = np.diff(speeds) / DT_S
    assert change.min() >= -EMERGENCY_MPS2 - 1e-9
    assert np.diff(change).min() / DT_S >= -HARD_JERK_MPS3 - 1e-6
    assert (change <= 1e-9).all()


def test_the_driver_goes_on_until_its_response_is_over() -> None:
    speeds, _ = driven(15.0, 60.0, 1.0, 3.0)
    np.testing.assert_allclose(speeds[:11], 15.0)
    assert speeds[12] < 15.0


def test_a_stop_that_is_too_easy_is_put_off() -> None:
    late, _ = driven(14.0, 90.0, 0.5, 4.0)
    early, _ = driven(14.0, 90.0, 0.5, 1.5)
    begins = [int(np.flatnonzero(speeds < 14.0)[0]) for speeds in (late, early)]
    assert begins[0] > begins[1] + 10
    assert np.diff(late).min() / DT_S == pytest.approx(-0.75 * 4.0, rel=0.15)


def test_a_leader_who_brakes_it_harder_changes_the_plan_and_nothing_breaks() -> None:
    plan = StopPlan(60.0, 0.0, 3.0, EMERGENCY_MPS2, speed_mps=15.0)
    speed = 15.0
    for step in range(200):
        after = plan.next_speed(speed, DT_S)
        speed = speed if after is None else after
        if 5 <= step < 15:
            speed = max(0.0, speed - 0.5)  # somebody else had a say
        plan.moved(speed, DT_S)
    assert speed < 1.0
    assert plan.distance_m > 0.0


def test_too_late_is_negative() -> None:
    assert latest_response_s(speed_mps=20.0, distance_m=20.0, deceleration_mps2=7.5) < 0.0
    assert latest_response_s(speed_mps=20.0, distance_m=200.0, deceleration_mps2=7.5) > 7.0
    assert math.isfinite(latest_response_s(speed_mps=0.1, distance_m=1.0, deceleration_mps2=7.5))


@pytest.mark.parametrize(("speed", "distance"), [(0.2, 3.0), (1.0, 8.0), (5.0, 60.0)])
def test_who_creeps_does_not_speed_up_and_stands_before_the_line(speed: float, distance: float) -> None:
    speeds, plan = driven(speed, distance, 0.5, 3.0)
    assert (np.diff(speeds) <= 1e-9).all()
    assert speeds[-1] == 0.0
    assert plan.distance_m > 0.0
