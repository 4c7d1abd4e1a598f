import gymnasium as gym
import numpy as np
import pytest

from stylesim.envs.action import META_ACTIONS, ActionDecoder
from stylesim.envs.config import EnvConfig
from stylesim.errors import InputError

CONFIG = EnvConfig(max_speed_mps=30.0, max_acceleration_mps2=3.0, max_deceleration_mps2=8.0)


def test_the_meta_actions_are_those_of_highway_env_in_its_order() -> None:
    from highway_env.envs.common.action import DiscreteMetaAction

    assert dict(enumerate(META_ACTIONS)) == DiscreteMetaAction.ACTIONS_ALL


@pytest.mark.parametrize(
    ("action", "speed", "target"), [(3, 14.0, 20.0), (4, 14.0, 10.0), (3, 29.0, 30.0), (4, 1.0, 0.0), (3, 0.0, 5.0)]
)
def test_faster_and_slower_aim_at_the_next_step_from_the_driven_speed(action: int, speed: float, target: float) -> None:
    decoder = ActionDecoder("discrete", CONFIG)
    assert decoder.command(action, speed).target_speed_mps == target


def test_idle_keeps_the_target_and_lane_actions_do_not_touch_it() -> None:
    decoder = ActionDecoder("discrete", CONFIG)
    decoder.reset(13.0)
    assert decoder.command(1, 9.0).target_speed_mps == 13.0
    assert decoder.command(0, 9.0) == (0.0, 13.0, 1)
    assert decoder.command(2, 9.0) == (0.0, 13.0, -1)


def test_a_continuous_action_scales_each_side_to_its_own_limit() -> None:
    decoder = ActionDecoder("continuous", CONFIG)
    assert decoder.command(np.array([1.0, 0.0], np.float32), 5.0).acceleration_mps2 == 3.0
    assert decoder.command(np.array([-0.5, 0.0], np.float32), 5.0).acceleration_mps2 == -4.0
    sides = [decoder.command(np.array([0.0, w], np.float32), 5.0).lane_change for w in (-1.0, -0.2, 0.2, 1.0)]
    assert sides == [-1, 0, 0, 1]


def test_the_pedal_stays_within_the_limits_of_the_car() -> None:
    decoder = ActionDecoder("discrete", CONFIG)
    decoder.reset(30.0)
    assert decoder.command(1, 0.0).wished_acceleration(0.0, CONFIG) == 3.0
    decoder.reset(0.0)
    assert decoder.command(1, 30.0).wished_acceleration(30.0, CONFIG) == -8.0


@pytest.mark.parametrize("action", [5, -1])
def test_an_unknown_meta_action_is_refused(action: int) -> None:
    with pytest.raises(InputError, match="LANE_LEFT"):
        ActionDecoder("discrete", CONFIG).command(action, 1.0)


@pytest.mark.parametrize("action", [np.zeros(3), np.array([np.nan, 0.0])])
def test_a_malformed_continuous_action_is_refused(action: np.ndarray) -> None:
    with pytest.raises(InputError, match="two finite numbers"):
        ActionDecoder("continuous", CONFIG).command(action, 1.0)


def test_spaces() -> None:
    assert ActionDecoder("discrete", CONFIG).space == gym.spaces.Discrete(5)
    assert ActionDecoder("continuous", CONFIG).space == gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
