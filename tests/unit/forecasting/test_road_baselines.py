from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.forecast import ForecastTask
from stylesim.forecasting.fan import KinematicFan
from stylesim.forecasting.road_baselines import IdmRollout, LaneFollowing
from stylesim.geometry import project
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.signals import Signals, SignalState
from stylesim.tracks import Tracks
from stylesim.windows import WindowSpec


def driving(x0: list[float], speed: list[float], road: Road, signals: Signals | None = None, frames: int = 60) -> Scene:
    """Cars along +x on y = 0 at constant speeds."""
    n, t = len(x0), np.arange(frames) * 0.1
    position = np.zeros((n, frames, 2))
    position[..., 0] = np.array(x0)[:, None] + np.array(speed)[:, None] * t
    velocity = np.zeros_like(position)
    velocity[..., 0] = np.array(speed)[:, None]
    tracks = Tracks(
        agent_id=tuple(f"c{i}" for i in range(n)), kind=np.ones(n, np.int8), size_m=np.tile([4.0, 1.8], (n, 1)),
        position_m=position, velocity_mps=velocity, heading_rad=np.zeros((n, frames)), valid=np.ones((n, frames), bool),
        dt_s=0.1,
    )  # fmt: skip
    return Scene("s", "s", "made", "bend", tracks, road=road, signals=signals)


def ask(scene: Scene, steps: int = 60) -> ForecastTask:
    return ForecastTask(scene.history(49, 50), np.arange(scene.tracks.n_agents), steps, 49)


ARC = 40.0 * np.stack([np.sin(np.linspace(0, np.pi / 2, 40)), 1 - np.cos(np.linspace(0, np.pi / 2, 40))], axis=1)
STRAIGHT = Lane("in", np.array([[-50.0, 0.0], [60.0, 0.0]]), width_m=3.5, speed_limit_mps=10.0, successors=("l", "s"))
FORK = Road((
    STRAIGHT,
    Lane("l", ARC + np.array([60.0, 0.0]), width_m=3.5),
    Lane("s", np.array([[60.0, 0.0], [200.0, 0.0]]), width_m=3.5),
))  # fmt: skip


def test_lane_following_gives_a_mode_for_each_way_of_a_fork() -> None:
    forecast = LaneFollowing().predict([ask(driving([0.0], [10.0], FORK))])[0]
    assert forecast.mode_m.shape[1] == 2
    np.testing.assert_allclose(forecast.probability[0], [0.5, 0.5])
    straight, left = forecast.mode_m[0]  # from x = 49, 60 m further; the straightest way first
    np.testing.assert_allclose(straight[-1], [109.0, 0.0], atol=0.05)
    _, _, distance, _ = project(left[20:], ARC + np.array([60.0, 0.0]))
    assert distance.max() < 0.05
    assert np.linalg.norm(np.diff(left, axis=0), axis=1).max() < 1.01


def test_without_a_road_it_turns_as_before() -> None:
    scene = replace(driving([0.0], [10.0], FORK), road=None)
    forecast = LaneFollowing().predict([ask(scene)])[0]
    assert forecast.mode_m.shape[1] == 1
    np.testing.assert_allclose(forecast.mode_m[0, 0, -1], [109.0, 0.0], atol=0.05)


def test_idm_speeds_up_to_the_limit_and_no_further() -> None:
    long = Road((Lane("a", np.array([[-50.0, 0.0], [900.0, 0.0]]), width_m=3.5, speed_limit_mps=14.0),))
    path = IdmRollout().predict([ask(driving([0.0], [10.0], long), steps=300)])[0].mode_m[0, 0, :, 0]
    speed = np.diff(path) / 0.1
    assert 10.0 <= speed[0] < 10.2
    assert 13.5 < speed[-1] < 14.01
    assert (np.diff(speed) > -1e-3).all()


def test_idm_does_not_drive_into_its_leader() -> None:
    long = Road((Lane("a", np.array([[-50.0, 0.0], [900.0, 0.0]]), width_m=3.5, speed_limit_mps=14.0),))
    scene = driving([0.0, 70.0], [12.0, 4.0], long)  # 27 m at t0, which close in 3.3 s
    behind, ahead = IdmRollout().predict([ask(scene, steps=100)])[0].mode_m[:, 0, :, 0]
    assert (ahead - behind - 4.0 > -1e-3).all()


def test_idm_stops_at_red_and_not_at_green() -> None:
    stop = Lane(
        "a", np.array([[-50.0, 0.0], [100.0, 0.0]]), width_m=3.5, speed_limit_mps=12.0,
        stop_line_m=np.array([[100.0, -1.7], [100.0, 1.7]]), successors=("b",),
    )  # fmt: skip
    road = Road((stop, Lane("b", np.array([[100.0, 0.0], [300.0, 0.0]]), width_m=3.5, speed_limit_mps=12.0)))
    for state, stands in ((SignalState.RED, True), (SignalState.GREEN, False)):
        signals = Signals(("x",), (("a",),), np.full((1, 60), state))
        path = IdmRollout().predict([ask(driving([0.0], [10.0], road, signals), steps=150)])[0].mode_m[0, 0, :, 0]
        assert (path[-1] + 2.0 < 100.0) == stands


def test_a_fan_recovers_what_drivers_do() -> None:
    """Half of them keep their speed, half brake at 1 m/s2: the two largest modes say so."""
    scenes = []
    for number in range(6):
        base = driving([0.0, 500.0], [15.0, 15.0], FORK, frames=120)
        t = np.arange(120) * 0.1
        x = base.tracks.position_m.copy()
        v = base.tracks.velocity_mps.copy()
        late = np.maximum(t - 4.9, 0.0)
        x[1, :, 0] -= (late**2 / 2).astype(np.float32)
        v[1, :, 0] -= late.astype(np.float32)
        scenes.append(replace(base, scene_id=f"s{number}", tracks=replace(base.tracks, position_m=x, velocity_mps=v)))
    rng = np.random.default_rng(0)
    jittered = [
        replace(s, tracks=replace(s.tracks, position_m=s.tracks.position_m + rng.normal(0, 1e-3, (2, 120, 2))))
        for s in scenes
    ]
    fan = KinematicFan().fit(jittered, WindowSpec(5.0, 6.0, 100.0))
    assert fan.acceleration_mps2 is not None and fan.probability is not None and fan.turn_rate_radps is not None
    assert fan.acceleration_mps2.max() == pytest.approx(0.0, abs=0.02)
    assert fan.acceleration_mps2.min() == pytest.approx(-1.0, abs=0.02)
    assert np.abs(fan.turn_rate_radps).max() < 0.01
    assert fan.probability.sum() == pytest.approx(1.0)


def test_a_fan_must_be_fitted_and_on_enough() -> None:
    with pytest.raises(InputError, match="fitted"):
        KinematicFan().predict([ask(driving([0.0], [10.0], FORK))])
    with pytest.raises(InputError, match="only 0"):
        KinematicFan().fit([], WindowSpec())
