import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.datasets.differences import causal_velocity


@given(
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.integers(1, 3),
    st.integers(7, 20),
    st.integers(0, 1000),
)
@settings(max_examples=60, deadline=None)
def test_exact_for_constant_acceleration_on_any_clock(c, stride, n, seed):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.3, 0.7, n))
    x = c[0] + c[1] * time + c[2] * time**2
    position = np.stack([x, -x], -1)[None]
    velocity, ahead = causal_velocity(position, np.ones((1, n), bool), time, stride)
    true = c[1] + 2 * c[2] * time
    np.testing.assert_allclose(velocity[0, 2 * stride :, 0], true[2 * stride :], atol=1e-8)
    assert ahead[0].tolist() == [1] + [0] * (n - 1)


@pytest.mark.parametrize("stride", [1, 2, 3])
def test_nothing_later_than_it_says_is_used(stride):
    rng = np.random.default_rng(stride)
    position = rng.normal(size=(6, 30, 2)).cumsum(axis=1)
    valid = rng.random((6, 30)) < 0.6
    position[~valid] = np.nan
    time = np.arange(30) * 0.1
    velocity, ahead = causal_velocity(position, valid, time, stride)
    for now in range(30):
        cut_valid = valid.copy()
        cut_valid[:, now + 1 :] = False
        cut, _ = causal_velocity(np.where(cut_valid[..., None], position, np.nan), cut_valid, time, stride)
        known = valid[:, now] & (ahead[:, now] == 0) & np.isfinite(velocity[:, now]).all(-1)
        np.testing.assert_array_equal(cut[known, now], velocity[known, now])


def test_a_single_frame_has_no_velocity():
    position = np.full((1, 9, 2), np.nan)
    position[0, 4] = 1.0
    velocity, _ = causal_velocity(position, np.isfinite(position).all(-1), np.arange(9) * 0.1, 2)
    assert np.isnan(velocity).all()
