"""What every `Forecaster` must do. To test your own, subclass `ForecasterContract` and give it a `forecaster` fixture:

    class TestMine(ForecasterContract):
        @pytest.fixture
        def forecaster(self):
            return MyForecaster()

`future_steps` is how far yours can look (frames of 0.1 s).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
import torch

from stylesim.errors import InputError
from stylesim.forecast import Forecast, Forecaster, ForecastTask
from stylesim.forecasting.arrays import FOOT_M, ArrayForecaster
from stylesim.forecasting.baselines import ConstantTurnRate, ConstantVelocity
from stylesim.forecasting.config import InputConfig, model_config
from stylesim.forecasting.fan import KinematicFan
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.road_baselines import IdmRollout, LaneFollowing
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, target_agents
from tests.conftest import make_scene

SPEC = WindowSpec(history_s=2.0, future_s=3.0)
T0 = 40


def asked(scene: Scene, agents: Sequence[int] | None = None, t0: int = T0, future_steps: int = 30) -> ForecastTask:
    history = SPEC.steps(scene.tracks.dt_s)[0]
    chosen = target_agents(scene, t0, SPEC) if agents is None else np.asarray(agents, np.int32)
    return ForecastTask(scene.history(t0, history), chosen, future_steps, t0)


def same(a: Forecast, b: Forecast) -> bool:
    return a.mode_m.tobytes() == b.mode_m.tobytes() and a.probability.tobytes() == b.probability.tobytes()


class ForecasterContract:
    """The tests; subclasses give the fixture `forecaster`."""

    future_steps = 30

    def ask(self, scene: Scene, agents: Sequence[int] | None = None) -> ForecastTask:
        return asked(scene, agents, future_steps=self.future_steps)

    def test_it_is_a_forecaster_with_a_name(self, forecaster: Forecaster) -> None:
        assert isinstance(forecaster, Forecaster)
        assert forecaster.name

    def test_one_forecast_per_task_one_row_per_driver(self, forecaster: Forecaster) -> None:
        tasks = [self.ask(make_scene("a", n_agents=5)), self.ask(make_scene("b", n_agents=9, seed=1))]
        forecasts = forecaster.predict(tasks)
        assert len(forecasts) == len(tasks)
        for task, forecast in zip(tasks, forecasts, strict=True):
            modes = forecast.probability.shape[1]
            assert modes >= 1
            assert forecast.mode_m.shape == (len(task.agent_index), modes, self.future_steps, 2)
            np.testing.assert_allclose(forecast.probability.sum(axis=1), 1.0, atol=1e-3)

    def test_rows_follow_the_order_of_agent_index(self, forecaster: Forecaster) -> None:
        scene = make_scene(n_agents=6)
        forward, backward = forecaster.predict([self.ask(scene, [0, 1, 2]), self.ask(scene, [2, 1, 0])])
        np.testing.assert_allclose(forward.mode_m, backward.mode_m[::-1], atol=1e-3)

    def test_forecasts_begin_where_the_driver_is(self, forecaster: Forecaster) -> None:
        task = self.ask(make_scene(n_agents=6))
        forecast = forecaster.predict([task])[0]
        here = task.scene.tracks.position_m[task.agent_index, -1]
        step = np.linalg.norm(forecast.mode_m[:, :, 0] - here[:, None], axis=-1)
        assert step.max() < 10.0  # in the scene's frame, metres, first step at 0.1 s: not 10 m away

    def test_the_same_question_has_the_same_answer(self, forecaster: Forecaster) -> None:
        task = self.ask(make_scene())
        assert same(forecaster.predict([task])[0], forecaster.predict([task])[0])

    def test_the_question_is_not_changed(self, forecaster: Forecaster) -> None:
        task = self.ask(make_scene())
        before = task.scene.tracks.position_m.copy()
        forecaster.predict([task])
        np.testing.assert_array_equal(task.scene.tracks.position_m, before)

    def test_without_road_and_signals(self, forecaster: Forecaster) -> None:
        bare = replace(make_scene(), road=None, signals=None)
        assert np.isfinite(forecaster.predict([self.ask(bare)])[0].mode_m).all()

    def test_a_driver_alone_and_one_who_came_late(self, forecaster: Forecaster) -> None:
        alone = make_scene(n_agents=2, n_frames=130)
        assert len(forecaster.predict([self.ask(alone, [0])])[0].mode_m) == 1
        late = make_scene(n_agents=5, n_frames=110)  # car-4 comes at frame 27
        assert len(forecaster.predict([self.ask(late, [4])])[0].mode_m) == 1

    def test_no_tasks_and_no_drivers(self, forecaster: Forecaster) -> None:
        assert forecaster.predict([]) == []
        assert len(forecaster.predict([self.ask(make_scene(), [])])[0].mode_m) == 0

    def test_what_lies_after_t0_plays_no_part(self, forecaster: Forecaster) -> None:
        scene = make_scene(n_agents=6)
        tracks = scene.tracks
        later = np.arange(tracks.n_frames) > T0
        position = np.where(later[:, None], np.float32(0), tracks.position_m)
        other = replace(scene, tracks=replace(tracks, position_m=position, driver=(None,) * tracks.n_agents))
        agents = target_agents(scene, T0, SPEC).tolist()
        assert same(*forecaster.predict([self.ask(scene, agents)]), *forecaster.predict([self.ask(other, agents)]))

    def test_a_driver_unknown_at_t0_is_refused(self, forecaster: Forecaster) -> None:
        scene = make_scene(n_frames=200)  # car-4 comes at frame 50
        with pytest.raises(InputError):
            forecaster.predict([self.ask(scene, [4])])


class TestConstantVelocity(ForecasterContract):
    @pytest.fixture
    def forecaster(self) -> Forecaster:
        return ConstantVelocity()


class TestConstantTurnRate(ForecasterContract):
    @pytest.fixture
    def forecaster(self) -> Forecaster:
        return ConstantTurnRate()


class TestTrainedForecaster(ForecasterContract):
    @pytest.fixture
    def forecaster(self) -> Forecaster:
        torch.manual_seed(0)
        network = ForecastNetwork(model_config("tiny", InputConfig.of(SPEC, 0.1)))
        network.intention_mps2.normal_()
        return TrainedForecaster("tiny", network, None)


class TestLaneFollowing(ForecasterContract):
    @pytest.fixture
    def forecaster(self) -> Forecaster:
        return LaneFollowing()


class TestIdmRollout(ForecasterContract):
    @pytest.fixture
    def forecaster(self) -> Forecaster:
        return IdmRollout()


class TestKinematicFan(ForecasterContract):
    @pytest.fixture
    def forecaster(self) -> Forecaster:
        return KinematicFan().fit([make_scene("a", n_agents=9), make_scene("b", n_agents=9, seed=1)], SPEC)


class TestArrayForecaster(ForecasterContract):
    """A foreign model at 2 Hz, in feet, without a map."""

    @pytest.fixture
    def forecaster(self) -> Forecaster:
        return ArrayForecaster(
            "feet", constant_velocity_in_feet, dt_s=0.5, history_s=2.0, future_s=4.0, unit_m=FOOT_M, road=False
        )


def constant_velocity_in_feet(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    velocity = arrays["agent"][:, 0, -1, 2:4]
    return velocity[:, None] * (0.5 * np.arange(1, 9))[:, None]
