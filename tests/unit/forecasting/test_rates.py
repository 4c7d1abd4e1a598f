from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.forecasting.rates import history_at, path_at
from tests.conftest import make_scene


def test_a_slower_rate_takes_every_fifth_frame_and_ends_at_t0() -> None:
    scene = make_scene(n_frames=60).history(49, 50)
    slow = history_at(scene, dt_s=0.5, steps=4)
    np.testing.assert_array_equal(slow.tracks.position_m, scene.tracks.position_m[:, [34, 39, 44, 49]])
    np.testing.assert_array_equal(slow.signals.state, scene.signals.state[:, [34, 39, 44, 49]])
    assert slow.tracks.dt_s == 0.5


def test_a_faster_rate_goes_linearly_between_frames() -> None:
    scene = make_scene(n_frames=60).history(49, 50)
    fast = history_at(scene, dt_s=0.05, steps=3)
    middle = (scene.tracks.position_m[:, 48].astype(float) + scene.tracks.position_m[:, 49]) / 2
    np.testing.assert_allclose(fast.tracks.position_m[:4, 1], middle[:4], atol=1e-3)
    np.testing.assert_allclose(fast.tracks.position_m[:, 2], scene.tracks.position_m[:, 49])


def test_what_is_before_the_history_or_beside_a_gap_is_not_known() -> None:
    scene = make_scene(n_frames=60).history(20, 21)  # car-4 comes at frame 15
    long = history_at(scene, dt_s=0.5, steps=6)
    assert long.tracks.valid[0].tolist() == [False, True, True, True, True, True]
    assert long.tracks.valid[4].tolist() == [False, False, False, False, True, True]
    between = history_at(scene, dt_s=0.25, steps=3)  # frames 15, 17.5, 20
    assert between.tracks.valid[4].tolist() == [True, True, True]
    assert np.isnan(long.tracks.position_m[~long.tracks.valid]).all()


@settings(max_examples=30, deadline=None)
@given(st.sampled_from([0.05, 0.1, 0.2, 0.5, 0.3]), st.floats(-20, 20), st.floats(-20, 20))
def test_a_straight_path_stays_itself_at_any_rate(dt_s: float, vx: float, vy: float) -> None:
    velocity, start = np.array([vx, vy]), np.array([[3.0, -2.0]])
    steps = round(6.0 / dt_s)
    path = start[:, None, None] + velocity * (dt_s * np.arange(1, steps + 1))[:, None]
    found = path_at(path, start, dt_s=dt_s, wanted_dt_s=0.1, steps=60)
    np.testing.assert_allclose(found[0, 0], start + velocity * (0.1 * np.arange(1, 61))[:, None], atol=1e-9)


def test_a_short_forecast_is_not_stretched() -> None:
    with pytest.raises(ValueError, match="ends after 2 s"):
        path_at(np.zeros((1, 1, 4, 2)), np.zeros((1, 2)), dt_s=0.5, wanted_dt_s=0.1, steps=30)
