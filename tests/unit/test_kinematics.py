from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_filter

from stylesim.kinematics import (
    Smoother,
    closing_on_neighbours,
    corridor_leaders,
    displaced,
    motion,
    time_headway_s,
    time_to_collision_s,
)
from stylesim.kinematics.smoothing import derivatives

DT = 0.1


def run_of(valid: np.ndarray) -> np.ndarray:
    return np.where(valid, 0, -1).astype(np.int32)


def test_smoother_agrees_with_scipy_in_the_middle_and_at_the_ends() -> None:
    values = np.random.default_rng(0).normal(size=(2, 40))
    curve = derivatives(values[..., None], np.zeros((2, 40), np.int32), DT, Smoother())[:, :, 0]
    for order in range(4):
        wanted = savgol_filter(values, 11, 3, deriv=order, delta=DT, mode="interp")
        np.testing.assert_allclose(curve[..., order], wanted, rtol=1e-8, atol=1e-8)


def test_a_cubic_is_reproduced_exactly() -> None:
    t = np.arange(30) * DT
    curve = derivatives((2 + 3 * t + 0.5 * t**2 - t**3)[None, :, None], np.zeros((1, 30), np.int32), DT, Smoother())
    wanted = np.stack([2 + 3 * t + 0.5 * t**2 - t**3, 3 + t - 3 * t**2, 1 - 6 * t, np.full(30, -6.0)], axis=-1)
    np.testing.assert_allclose(curve[0, :, 0], wanted, atol=1e-8)


def test_runs_are_smoothed_alone_and_short_ones_are_missing() -> None:
    values = np.random.default_rng(1).normal(size=(1, 40, 1))
    run = np.full((1, 40), -1, np.int32)
    run[0, :8], run[0, 10:30], run[0, 30:34] = 0, 1, 2
    curve = derivatives(values, run, DT, Smoother())
    alone = derivatives(values[:, 10:30], np.zeros((1, 20), np.int32), DT, Smoother())
    np.testing.assert_array_equal(curve[:, 10:30], alone)
    assert np.isfinite(curve[0, :8]).all()
    assert np.isnan(curve[0, 30:]).all()
    assert np.isnan(curve[0, 8:10]).all()


def test_constant_speed_has_no_jerk_straight_or_on_a_circle() -> None:
    t = np.arange(60) * DT
    straight = np.stack([10 * t, 0 * t], axis=-1)
    circle = 50 * np.stack([np.cos(0.2 * t), np.sin(0.2 * t)], axis=-1)
    heading = np.stack([0 * t, 0.2 * t + np.pi / 2])
    moved = motion(np.stack([straight, circle]), heading, np.zeros((2, 60), np.int32), dt_s=DT)
    assert np.abs(moved.jerk_mps3[0]).max() < 1e-6
    assert np.abs(moved.jerk_mps3[1]).max() < 1e-2  # what a cubic misses of a 10 m/s bend of 50 m at its ends
    np.testing.assert_allclose(moved.speed_mps, 10.0, atol=1e-3)
    np.testing.assert_allclose(moved.acceleration_mps2, 0.0, atol=2e-3)


def test_smoother_refuses_an_order_without_jerk() -> None:
    with pytest.raises(ValueError, match="order 3"):
        Smoother(order=2)


def test_displacement_is_within_the_run() -> None:
    position = np.zeros((1, 20, 2))
    position[0, 10:, 0] = 5.0
    run = np.repeat([[0, 1]], 10, axis=1).astype(np.int32)
    assert not displaced(position, run, 1.0).any()
    assert displaced(position, np.zeros((1, 20), np.int32), 1.0).all()


def test_closing_equals_the_sum_over_all_pairs() -> None:
    rng = np.random.default_rng(3)
    n, frames = 30, 12
    speed, angle = rng.uniform(2, 20, n), rng.uniform(-1, 1, n)
    velocity = speed[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    position = rng.uniform(0, 250, (n, 1, 2)) + velocity[:, None] * (np.arange(frames) * DT)[None, :, None]
    moved = motion(position, np.repeat(angle[:, None], frames, 1), np.zeros((n, frames), np.int32), dt_s=DT)
    ego, other = rng.random((n, frames)) < 0.8, rng.random((n, frames)) < 0.8
    found = closing_on_neighbours(
        moved, is_ego=ego, is_neighbour=other, radius_m=60.0, heading_within_rad=0.8, distance_floor_m=1.0
    )
    for a in range(n):
        for f in range(frames):
            total = count = 0
            for b in range(n):
                away = np.hypot(*(moved.position_m[a, f] - moved.position_m[b, f]))
                turn = moved.direction[a, f] @ moved.direction[b, f]
                if b != a and ego[a, f] and other[b, f] and away <= 60 and turn >= np.cos(0.8):
                    total += max(0.0, moved.speed_mps[a, f] - moved.speed_mps[b, f]) / max(away, 1.0)
                    count += 1
            assert found.count[a, f] == count
            assert found.rate_per_s[a, f] == pytest.approx(total)


def test_corridor_leader_is_whom_one_would_meet() -> None:
    place = np.array([[0, 0], [60, 1.0], [30, 3.5], [20, 0], [80, 0]], float)[:, None, :]
    ways = np.array([0, 0, 0, np.pi, 0])
    direction = np.stack([np.cos(ways), np.sin(ways)], axis=-1)[:, None, :]
    here = np.ones((5, 1), bool)
    size = np.tile([4.0, 1.8], (5, 1))
    found = corridor_leaders(
        place, direction, size, is_ego=here, is_other=here, range_m=100.0, heading_within_rad=np.pi / 4
    )
    assert found.leader[:, 0].tolist() == [1, 4, -1, -1, -1]  # beside: not; oncoming: not
    assert found.gap_m[0, 0] == pytest.approx(56.0)


def test_headway_and_time_to_collision() -> None:
    gap, speed, other = np.array([20.0, 20.0, np.nan, 5.0]), np.array([10.0, 0.0, 3.0, 8.0]), np.full(4, 5.0)
    np.testing.assert_array_equal(time_headway_s(gap, speed), [2.0, np.inf, np.nan, 0.625])
    np.testing.assert_allclose(time_to_collision_s(gap, speed, other), [4.0, np.inf, np.nan, 5 / 3])
