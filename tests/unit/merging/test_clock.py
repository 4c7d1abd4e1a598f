from dataclasses import replace

import numpy as np
import pytest

from stylesim.merging.clock import on_common_clock
from stylesim.scene import Scene
from stylesim.signals import Signals
from stylesim.tracks import Tracks


def circling(dt_s: float, n_frames: int, *, missing: tuple[int, ...] = ()) -> Scene:
    """One car on a circle of 20 m at 10 m/s."""
    t = np.arange(n_frames) * dt_s
    angle = 0.5 * t
    position = 20.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)[None]
    velocity = 10.0 * np.stack([-np.sin(angle), np.cos(angle)], axis=1)[None]
    heading = (np.remainder(angle + np.pi / 2 + np.pi, 2 * np.pi) - np.pi)[None]
    valid = np.ones((1, n_frames), bool)
    valid[0, list(missing)] = False
    tracks = Tracks(
        ("a",), np.ones(1, np.int8), np.ones((1, 2)), np.where(valid[..., None], position, np.nan),
        np.where(valid[..., None], velocity, np.nan), np.where(valid, heading, np.nan), valid, dt_s,
    )  # fmt: skip
    signals = Signals(("l",), ((),), (np.arange(n_frames)[None] % 5).astype(np.int8))
    return Scene("s", "u", "made", "x", tracks, signals=signals)


def test_the_common_clock_is_left_alone():
    scene = circling(0.1, 30)
    assert on_common_clock(scene) is scene


def test_a_step_that_divides_is_decimated_exactly():
    fine = circling(0.02, 51)
    coarse = on_common_clock(replace(fine, t0_frame=27)).tracks
    np.testing.assert_array_equal(coarse.position_m, fine.tracks.position_m[:, ::5])
    np.testing.assert_array_equal(coarse.velocity_mps, fine.tracks.velocity_mps[:, ::5])
    np.testing.assert_allclose(coarse.heading_rad, fine.tracks.heading_rad[:, ::5], atol=1e-6)
    assert coarse.lookahead_steps is not None
    assert not coarse.lookahead_steps.any()
    assert on_common_clock(replace(fine, t0_frame=27)).t0_frame == 5


@pytest.mark.parametrize("rate_hz", [29.97, 25.0, 4.0, 2.0])
def test_other_rates_are_interpolated_without_new_accelerations(rate_hz):
    scene = on_common_clock(circling(1 / rate_hz, round(8 * rate_hz)))
    tracks = scene.tracks
    t = np.arange(tracks.n_frames) * 0.1
    truth = 20.0 * np.stack([np.cos(0.5 * t), np.sin(0.5 * t)], axis=1)
    assert tracks.valid.all()
    assert tracks.dt_s == 0.1
    assert np.abs(tracks.position_m[0] - truth).max() < 0.01
    acceleration = np.hypot(*np.diff(tracks.velocity_mps[0].astype(np.float64), axis=0).T) / 0.1
    assert acceleration.max() < 5.0 * 1.01  # v^2 / r
    turned = np.abs(np.diff(np.unwrap(tracks.heading_rad[0].astype(np.float64))))
    assert turned.max() < 0.05 * 1.01
    assert scene.signals is not None
    assert scene.signals.state.shape[1] == tracks.n_frames


def test_an_interpolated_frame_is_known_only_with_its_later_neighbour():
    scene = on_common_clock(circling(0.5, 10, missing=(4,)))
    tracks = scene.tracks
    assert np.flatnonzero(~tracks.valid[0]).tolist() == [*range(16, 25)]
    assert tracks.lookahead_steps is not None
    assert tracks.lookahead_steps[0, :6].tolist() == [0, 4, 3, 2, 1, 0]
    assert np.flatnonzero(scene.history(7, 20).tracks.valid[0]).tolist() == [0, 1, 2, 3, 4, 5]


def test_lights_hold_the_earlier_state():
    scene = on_common_clock(circling(0.25, 9))
    assert scene.signals is not None
    assert scene.signals.state[0, :8].tolist() == [0, 0, 0, 1, 1, 2, 2, 2]
