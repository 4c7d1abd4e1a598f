import numpy as np
import pytest

from stylesim.envs.config import EnvConfig, configured
from stylesim.envs.reward import cost_terms, reward_terms, time_to_collision_s
from stylesim.envs.world import EgoState
from stylesim.errors import InputError
from tests.unit.envs.snapshots import made_snapshot

CONFIG = EnvConfig(period_s=0.5, duration_s=60.0)


def test_progress_is_paid_up_to_the_speed_limit() -> None:
    at_limit = EgoState(speed_limit_mps=10.0, travelled_m=5.0)
    assert reward_terms(at_limit, CONFIG)["progress"] == pytest.approx(0.1 * 0.5)
    assert reward_terms(at_limit._replace(travelled_m=9.0), CONFIG) == reward_terms(at_limit, CONFIG)
    assert reward_terms(at_limit._replace(travelled_m=2.5), CONFIG)["progress"] == pytest.approx(0.025)


def test_arriving_is_worth_the_rest_of_the_time_at_full_progress() -> None:
    arrived = EgoState(speed_limit_mps=10.0, time_s=20.0, arrived=1.0)
    assert reward_terms(arrived, CONFIG)["progress"] == pytest.approx(0.1 * 40.0)


def test_comfort_collision_and_red() -> None:
    terms = reward_terms(EgoState(rms_acceleration_mps2=6.0, collided=1.0, reds_run=1.0), CONFIG)
    assert terms["comfort"] == pytest.approx(-0.02 * 0.5 * 4.0)
    assert (terms["collision"], terms["red"]) == (-10.0, -4.0)


def test_waiting_out_a_red_costs_less_than_running_it() -> None:
    weights = CONFIG.reward
    assert 30.0 * weights.progress < weights.red < weights.collision


def test_time_to_collision_looks_along_the_corridor_only() -> None:
    ahead = made_snapshot([(119.5, 50.0, 5.0, 0.0, 0.0)])  # 15 m between the boxes, closing at 5 m/s
    assert time_to_collision_s(ahead) == pytest.approx(3.0)
    beside = made_snapshot([(119.5, 53.5, 5.0, 0.0, 0.0), (80.0, 50.0, 20.0, 0.0, 0.0), (150.0, 50.0, 12.0, 0.0, 0.0)])
    assert time_to_collision_s(beside) == np.inf


def test_cost_is_separate_and_rises_as_time_to_collision_falls() -> None:
    near = cost_terms(made_snapshot([(107.0, 50.0, 5.0, 0.0, 0.0)]), CONFIG)  # 2.5 m at 5 m/s: 0.5 s
    assert near["closeness"] == pytest.approx(0.1 * 0.5 * (1 - 0.5 / 1.5))
    hit = cost_terms(made_snapshot([], collided=1.0, reds_run=1.0), CONFIG)
    assert (hit["collision"], hit["red"], hit["closeness"]) == (1.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"duraton_s": 3}, "duration_s"),
        ({"reward": {"colision": 1}}, "collision"),
        ({"period_s": 0.25}, "multiple"),
        ({"onset_tts_s": (5.0, 2.0)}, "low <= high"),
    ],
)
def test_a_wrong_configuration_is_refused_with_the_key_that_was_meant(changes, words) -> None:
    with pytest.raises(InputError, match=words):
        configured(changes, where="config")
