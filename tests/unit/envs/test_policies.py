import gymnasium as gym
import numpy as np
import pytest

from stylesim.envs.action import META_ACTIONS
from stylesim.envs.policies import IdmEgo, policy
from stylesim.envs.registration import register
from stylesim.envs.scores import _interval, score
from stylesim.errors import InputError
from stylesim.signals import SignalState
from tests.unit.envs.conftest import quick_highway
from tests.unit.envs.snapshots import made_snapshot

register()


@pytest.fixture(scope="module")
def idm() -> IdmEgo:
    env = gym.make("stylesim/YellowLight-v0").unwrapped
    return IdmEgo(env)  # it is never reset, so no simulation is started


def wish(idm: IdmEgo, others=(), **ego) -> float:
    snapshot = made_snapshot(list(others), **ego)
    layout = idm._layout
    return idm.acceleration(layout.encode(snapshot, layout.nearest(snapshot), idm._config))


def test_free_road(idm: IdmEgo) -> None:
    assert wish(idm, speed=0.0) == pytest.approx(2.4)  # the neutral driver's acceleration
    assert wish(idm, speed=15.0) == pytest.approx(0.0, abs=1e-3)  # at the speed limit


def test_it_brakes_for_a_leader_but_not_for_the_next_lane(idm: IdmEgo) -> None:
    assert wish(idm, [(115.0, 50.0, 5.0, 0.0, 0.0)]) < -3.0
    assert wish(idm, [(115.0, 53.5, 5.0, 0.0, 0.0)]) == wish(idm)
    assert wish(idm, [(85.0, 50.0, 15.0, 0.0, 0.0)]) == wish(idm)


def test_it_stops_at_red_and_at_a_yellow_where_it_can(idm: IdmEgo) -> None:
    red, yellow = float(SignalState.RED), float(SignalState.YELLOW)
    assert wish(idm, signal_state=red, stop_line_m=20.0) < -2.0
    assert wish(idm, signal_state=yellow, stop_line_m=25.0) < -1.0
    assert wish(idm, signal_state=yellow, stop_line_m=10.0) == wish(idm)
    assert wish(idm, signal_state=float(SignalState.GREEN), stop_line_m=10.0) == wish(idm)


def test_actions_of_both_kinds(idm: IdmEgo) -> None:
    snapshot = made_snapshot([], speed=0.0)
    observation = idm._layout.encode(snapshot, idm._layout.nearest(snapshot), idm._config)
    assert META_ACTIONS[idm(observation)] == "FASTER"
    continuous = IdmEgo(gym.make("stylesim/YellowLight-v0", action_type="continuous").unwrapped)
    assert continuous(observation) == pytest.approx([2.4 / 3.0, 0.0])


def test_an_unknown_policy_is_refused() -> None:
    with pytest.raises(InputError, match="'random'"):
        policy("randm", gym.make("stylesim/YellowLight-v0"))


def test_scores_have_intervals_around_their_means() -> None:
    scores = score(
        "stylesim/Highway-v0", "idm", episodes=3, seed=0, scenario=quick_highway(), config={"duration_s": 3.0}
    )
    assert scores["return"].n == 3
    assert scores["collision"].mean == 0.0
    for item in scores.values():
        assert item.low <= item.mean <= item.high


def test_the_interval_of_a_mean_covers_as_the_normal_one_does() -> None:
    values = np.random.default_rng(0).normal(5.0, 2.0, 400)
    item = _interval(values, np.random.default_rng(1))
    half = 1.96 * values.std() / 20
    assert item.low == pytest.approx(values.mean() - half, abs=0.04)
    assert item.high == pytest.approx(values.mean() + half, abs=0.04)
