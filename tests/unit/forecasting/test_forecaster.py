from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.forecast import Forecast, ForecastTask
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.geometry import rotated
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from tests.conftest import make_scene

from .made import SPEC, task_of, untrained


def same(a: Forecast, b: Forecast) -> bool:
    return a.mode_m.tobytes() == b.mode_m.tobytes() and a.probability.tobytes() == b.probability.tobytes()


def moved(scene: Scene, angle_rad: float, by_m: np.ndarray) -> Scene:
    """The whole scene turned about the origin, then shifted."""

    def line(points: np.ndarray | None) -> np.ndarray | None:
        return None if points is None else (rotated(points.astype(np.float64), angle_rad) + by_m).astype(np.float32)

    assert scene.road is not None
    tracks = scene.tracks
    lanes = tuple(replace(lane, centre_line_m=line(lane.centre_line_m)) for lane in scene.road.lanes)
    turned = replace(
        tracks,
        position_m=line(tracks.position_m),
        velocity_mps=rotated(tracks.velocity_mps.astype(np.float64), angle_rad).astype(np.float32),
        heading_rad=(tracks.heading_rad + angle_rad).astype(np.float32),
    )
    return replace(scene, tracks=turned, road=Road(lanes))


@pytest.mark.parametrize("styled", [False, True])
def test_moving_the_scene_moves_the_forecast(styled: bool) -> None:
    model, scene = untrained(styled=styled), make_scene(n_agents=9)
    angle, by = 2.3, np.array([120.0, -75.0])
    here, there = model.predict([task_of(scene, 40), task_of(moved(scene, angle, by), 40)])
    expected = rotated(here.mode_m.astype(np.float64), angle) + by
    np.testing.assert_allclose(there.mode_m, expected, atol=2e-3)
    np.testing.assert_allclose(there.probability, here.probability, atol=1e-4)


def garbled(scene: Scene, t0: int) -> Scene:
    """The scene with everything after t0, the commanded styles and the outcome replaced."""
    tracks = scene.tracks
    later = np.arange(tracks.n_frames) > t0
    rng = np.random.default_rng(7)
    assert scene.signals is not None
    return replace(
        scene,
        tracks=replace(
            tracks,
            position_m=np.where(later[:, None], rng.normal(0, 99, tracks.position_m.shape), tracks.position_m),
            velocity_mps=np.where(later[:, None], rng.normal(0, 9, tracks.velocity_mps.shape), tracks.velocity_mps),
            heading_rad=np.where(later, 1.0, tracks.heading_rad),
            driver=(None,) * tracks.n_agents,
            flags=np.full(tracks.n_agents, 4095, np.int32),
        ),
        signals=replace(scene.signals, state=np.where(later, 4, scene.signals.state)),
        counts={"collisions": 17},
    )


@pytest.mark.parametrize("styled", [False, True])
def test_the_future_and_the_commanded_style_do_not_change_a_bit(styled: bool) -> None:
    model, scene = untrained(styled=styled), make_scene(n_agents=6)
    task = task_of(scene, 40)
    other = garbled(scene, 40)
    again = ForecastTask(other.history(40, SPEC.steps(0.1)[0]), task.agent_index, task.future_steps, 40)
    assert same(model.predict([task])[0], model.predict([again])[0])


def test_a_value_interpolated_across_t0_is_not_seen() -> None:
    model, scene = untrained(), make_scene(n_agents=6)
    ahead = np.zeros(scene.tracks.valid.shape, np.int16)
    ahead[2, 36:40] = 9
    results = []
    for shift in (0.0, 50.0):
        position = scene.tracks.position_m.copy()
        position[2, 36:40] += shift
        tracks = replace(scene.tracks, position_m=position, lookahead_steps=ahead)
        results.append(model.predict([task_of(replace(scene, tracks=tracks), 40)])[0])
    assert same(*results)


def test_batching_and_the_order_of_tasks_do_not_matter() -> None:
    model = untrained(styled=True)
    tasks = [task_of(make_scene(f"s{i}", seed=i, n_agents=4 + i), 40) for i in range(3)]
    together = model.predict(tasks)
    for task, forecast in zip(tasks, together, strict=True):
        alone = model.predict([task])[0]
        np.testing.assert_allclose(alone.mode_m, forecast.mode_m, atol=1e-4)
        np.testing.assert_allclose(alone.probability, forecast.probability, atol=1e-5)
    assert model.predict([]) == []


def test_what_if_gives_other_futures_and_none_the_unconditioned_one() -> None:
    model, task = untrained(styled=True), task_of(make_scene(), 40)
    fast, slow, none = (model.predict([task], style=style)[0] for style in ("fast", "slow", "none"))
    assert not np.allclose(fast.mode_m, slow.mode_m, atol=1e-3)
    assert not np.allclose(fast.mode_m, none.mode_m, atol=1e-3)
    assert model.styles == ("fast", "slow")
    with pytest.raises(InputError, match="Did you mean 'fast'"):
        model.predict([task], style="fst")


def test_a_shorter_future_is_the_beginning_of_the_longer_one() -> None:
    model, task = untrained(), task_of(make_scene(), 40)
    whole, part = model.predict([task, replace(task, future_steps=10)])
    np.testing.assert_array_equal(part.mode_m, whole.mode_m[:, :, :10])


def refused(model: TrainedForecaster, task: ForecastTask, match: str) -> None:
    with pytest.raises(InputError, match=match):
        model.predict([task])


def test_tasks_that_it_was_not_trained_for_are_refused() -> None:
    model, scene = untrained(), make_scene()
    task = task_of(scene, 40)
    refused(model, replace(task, future_steps=31), "31 future steps asked")
    coarse = replace(scene, tracks=replace(scene.tracks, dt_s=0.2))
    refused(model, ForecastTask(coarse.history(40, 10), task.agent_index, 10, 40), r"steps of 0\.2 s")
    late = ForecastTask(scene.history(10, 10), np.array([4], np.int32), 10, 10)
    refused(model, late, "'car-4' is not known at t0")
    with pytest.raises(InputError, match="trained without style"):
        model.predict([task], style="fast")


def test_an_empty_question_has_an_empty_answer() -> None:
    task = replace(task_of(make_scene(), 40), agent_index=np.zeros(0, np.int32))
    for styled in (False, True):
        assert untrained(styled=styled).predict([task])[0].mode_m.shape == (0, 6, 30, 2)


def test_a_driver_does_not_see_the_line_inferred_from_his_own_track() -> None:
    from stylesim.road import LaneEvidence

    scene = make_scene()
    assert scene.road is not None
    line = scene.road.lanes[0].centre_line_m
    results = []
    for mine in (0.5, 3.0):
        offset = np.stack([np.full(len(line), mine), np.full(len(line), 0.2)]).astype(np.float32)
        lane = Lane("right", line, evidence=LaneEvidence(("car-0", "car-1"), offset))
        task = task_of(replace(scene, road=Road((lane,), source="inferred")), 40)
        results.append(untrained().predict([task])[0])
    assert results[0].mode_m[0].tobytes() == results[1].mode_m[0].tobytes()
