"""Post-encroachment times and required decelerations that can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.kinematics import encroachments, required_deceleration_mps2, time_to_collision_s

DT_S, FRAMES = 0.1, 120
SIZE = np.array([[4.5, 1.8], [4.5, 1.8]])


def crossing(wait_s: float, *, turn_rad: float = np.pi / 2, origin: float = 0.0):
    """Two cars at 10 m/s whose centres pass the origin `wait_s` apart, the second at `turn_rad` to the first."""
    t = np.arange(FRAMES) * DT_S
    ahead = [np.array([1.0, 0.0]), np.array([np.cos(turn_rad), np.sin(turn_rad)])]
    away = [10.0 * (t - 4.0), 10.0 * (t - 4.0 - wait_s)]
    position = np.stack([a[:, None] * u for a, u in zip(away, ahead, strict=True)]) + origin
    heading = np.repeat([[0.0], [turn_rad]], FRAMES, axis=1)
    return position, heading


@pytest.mark.parametrize("wait_s", [1.0, 2.0, 3.5])
def test_the_time_between_leaving_and_entering_the_crossing(wait_s):
    """The first clears the other's width (0.9 m) with its rear, the second enters the first's with its front."""
    position, heading = crossing(wait_s)
    found = encroachments(position, heading, SIZE, np.ones((2, FRAMES), bool), dt_s=DT_S)
    by_hand = wait_s - 2 * (0.9 + 2.25) / 10.0
    # A grid of 0.5 m and frames of 0.1 s: up to a cell on either side, and a frame.
    assert found.pet_s.tolist() == [pytest.approx(by_hand, abs=0.16)]
    assert (found.first.tolist(), found.second.tolist()) == ([0], [1])


def test_being_there_at_once_is_no_time_at_all():
    position, heading = crossing(0.2)
    found = encroachments(position, heading, SIZE, np.ones((2, FRAMES), bool), dt_s=DT_S)
    assert 0.0 in found.pet_s.tolist()


def test_followers_and_those_long_after_are_no_encounter():
    for position, heading in (crossing(1.0, turn_rad=0.0), crossing(1.0, turn_rad=np.radians(20)), crossing(6.5)):
        found = encroachments(position, heading, SIZE, np.ones((2, FRAMES), bool), dt_s=DT_S)
        assert len(found.pet_s) == 0


def test_nobody_there():
    position, heading = crossing(1.0)
    found = encroachments(position, heading, SIZE, np.zeros((2, FRAMES), bool), dt_s=DT_S)
    assert len(found.pet_s) == 0


@given(st.floats(-300, 300), st.floats(0.8, 4.0))
@settings(max_examples=25, deadline=None)
def test_it_hardly_depends_on_where_the_grid_lies(origin, wait_s):
    times = []
    for at in (0.0, origin):
        position, heading = crossing(wait_s, origin=at)
        times.append(encroachments(position, heading, SIZE, np.ones((2, FRAMES), bool), dt_s=DT_S).pet_s)
    assert len(times[0]) == len(times[1]) == 1
    assert times[0][0] == pytest.approx(times[1][0], abs=0.31)


def test_required_deceleration():
    gap, own, leader = (
        np.array([20.0, 20.0, 0.0, np.nan]),
        np.array([15.0, 10.0, 5.0, 9.0]),
        np.array([5.0, 12.0, 1, 1]),
    )
    assert required_deceleration_mps2(gap, own, leader)[:3].tolist() == [pytest.approx(2.5), 0.0, np.inf]
    assert np.isnan(required_deceleration_mps2(gap, own, leader)[3])


@given(st.floats(0.5, 90), st.floats(0, 40), st.floats(0, 40))
def test_braking_so_hard_ends_the_closing_at_the_leaders_bumper(gap, own, leader):
    """With the required deceleration the closing speed is 0 after twice the time to collision, the gap used up."""
    if own - leader < 0.01:
        return
    needed = required_deceleration_mps2(*(np.array([v]) for v in (gap, own, leader)))[0]
    time = 2 * time_to_collision_s(*(np.array([v]) for v in (gap, own, leader)))[0]
    assert needed * time == pytest.approx(own - leader)
    assert (own - leader) * time - needed * time**2 / 2 == pytest.approx(gap)
