from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stylesim.simulation.flow import FASTEST, SLOWEST, flow_speed, wished_speed

AHEAD, BACK = np.array([1.0, 0.0]), np.array([-1.0, 0.0])


def around(position, direction, speed, wish=30.0):
    return flow_speed(
        np.array(position, float), np.array(direction, float), np.array(speed, float), np.full(len(speed), wish)
    )


def test_the_flow_is_the_others_within_sight_that_go_the_same_way():
    flow = around([[0, 0], [50, 0], [70, 3.5], [200, 0], [20, 10]], [AHEAD] * 4 + [BACK], [30, 20, 26, 10, 25])
    assert flow[0] == pytest.approx(20.0)  # the slower of two; not oneself, not the far one, not the oncoming one
    assert np.isnan(flow[3])
    assert np.isnan(flow[4])


def test_queues_set_no_example():
    flow = around([[0, 0], [50, 0]], [AHEAD] * 2, [30, 3])
    assert np.isnan(flow[0])


@given(st.floats(5, 45), st.floats(1, 45), st.floats(0, 1), st.floats(0.7, 1.4))
def test_the_wish_stays_near_the_own_one_and_is_it_without_traffic(own, flow, share, factor):
    wish = wished_speed(np.array([own]), np.array([flow]), share=np.array([share]), factor=np.array([factor]))
    assert SLOWEST * own - 1e-9 <= wish[0] <= FASTEST * own + 1e-9
    alone = wished_speed(np.array([own]), np.array([np.nan]), share=np.array([share]), factor=np.array([factor]))
    assert alone[0] == own


def test_who_gives_nothing_on_the_flow_keeps_the_own_wish():
    wish = wished_speed(np.array([30.0]), np.array([20.0]), share=np.array([0.0]), factor=np.array([1.4]))
    assert wish[0] == 30.0
