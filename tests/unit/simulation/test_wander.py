"""Lateral wander: sd, bounds, standstill, independence of drivers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.simulation.wander import lateral_wander, smoothed_slide
from stylesim.styles import style_table

NEUTRAL = style_table().at(0.0)
DT_S = 0.1


def wander(sds: list[float], speed: np.ndarray, *, limit_m: float = 10.0, seed: int = 0) -> np.ndarray:
    styles = [replace(NEUTRAL, lane_wander_m=sd) for sd in sds]
    streams = [np.random.default_rng([seed, index]) for index in range(len(sds))]
    return lateral_wander(styles, speed, limit_m=np.full(len(sds), limit_m), dt_s=DT_S, streams=streams)


def test_stationary_sd_is_the_style_s() -> None:
    path = wander([0.1, 0.2, 0.35], np.full((3, 40_000), 15.0))
    np.testing.assert_allclose(path.std(axis=1), [0.1, 0.2, 0.35], rtol=0.07)


def test_acceleration_is_bounded_and_there_are_no_jumps() -> None:
    speed = np.full((8, 3000), 20.0)
    path = wander([0.7] * 8, speed)
    assert np.abs(np.diff(path, axis=1)).max() < 0.2
    assert np.abs(np.diff(path, n=2, axis=1)).max() / DT_S**2 <= 4.0


def test_limit_keeps_a_wide_vehicle_in_its_lane() -> None:
    assert np.abs(wander([0.55] * 4, np.full((4, 5000), 15.0), limit_m=0.4)).max() < 0.45


def test_a_standing_vehicle_does_not_slide() -> None:
    speed = np.full((2, 600), 12.0)
    speed[:, 200:400] = 0.0
    path = wander([0.4, 0.4], speed)
    assert (np.diff(path[:, 199:400], axis=1) == 0.0).all()
    assert np.abs(np.diff(path[:, 399:], axis=1)).max() > 0.0


def test_another_driver_or_a_longer_episode_shifts_nobody() -> None:
    speed = np.full((3, 300), 10.0)
    all_three = wander([0.2, 0.3, 0.4], speed)
    np.testing.assert_array_equal(all_three[:2, :200], wander([0.2, 0.3], speed[:2, :200]))
    assert not np.array_equal(all_three, wander([0.2, 0.3, 0.4], speed, seed=1))


def test_lengths_must_agree() -> None:
    with pytest.raises(ValueError, match="styles"):
        lateral_wander(
            [NEUTRAL], np.ones((2, 5)), limit_m=np.ones(2), dt_s=DT_S, streams=[np.random.default_rng(0)] * 2
        )


def test_a_slide_is_smooth_late_by_half_a_second_and_complete() -> None:
    ramp = np.clip(np.arange(150) * DT_S - 2.0, 0.0, 3.5)[None]
    path = smoothed_slide(ramp, np.full((1, 150), 20.0), dt_s=DT_S)
    assert path[0, 20] == 0.0
    assert path[0, -1] == pytest.approx(3.5, abs=1e-3)
    assert path[0, 45] == pytest.approx(ramp[0, 40], abs=0.15)
    assert np.abs(np.diff(path, n=2)).max() / DT_S**2 < 2.5
    half_way = np.where(np.arange(150) < 35, 20.0, 0.0)[None]
    assert np.ptp(smoothed_slide(ramp, half_way, dt_s=DT_S)[0, 35:]) == 0.0
