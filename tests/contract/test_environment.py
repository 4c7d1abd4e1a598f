"""What every environment of stylesim promises; a stranger runs it on his own id by adding it to IDS."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from stylesim.envs.registration import IDS, register
from stylesim.errors import InputError
from stylesim.scenario import load_scenario, scenarios

register()


FULLY = ("stylesim/Highway-v0", "stylesim/YellowLight-v0")  # one of each simulator; the others in the slow run


def options(env_id: str) -> dict[str, Any]:
    """What makes an environment quick: a short warm-up, few cars, short episodes."""
    scenario = load_scenario(IDS[env_id])
    if scenario.backend == "highway":
        few = scenario.model_copy(update={"options": {**scenario.options, "vehicles": 6}})
        return {"scenario": few, "config": {"period_s": 0.2, "duration_s": 8.0}}
    short = scenario.model_copy(update={"warm_up_s": 5.0 if env_id == "stylesim/YellowLight-v0" else 20.0})
    return {"scenario": short, "config": {"duration_s": 15.0, "period_s": 0.2}}


def cases() -> list[Any]:
    """Every id; all but two are slow."""
    return [pytest.param(name, marks=() if name in FULLY else pytest.mark.slow) for name in sorted(IDS)]


@pytest.fixture(params=cases())
def env_id(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_every_scenario_has_an_id() -> None:
    assert set(IDS.values()) == set(scenarios())
    for env_id in IDS:
        assert gym.spec(env_id).entry_point is not None


@pytest.mark.parametrize("action_type", ["discrete", "continuous"])
def test_gymnasiums_own_check_finds_nothing(env_id: str, action_type: str) -> None:
    env = gym.make(env_id, action_type=action_type, render_mode="rgb_array", **options(env_id))
    check_env(env.unwrapped)


def rollout(env: gym.Env[Any, Any], seed: int, actions: list[Any]) -> list[Any]:
    observation, info = env.reset(seed=seed)
    seen = [(observation, info)]
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        seen.append((observation, reward, terminated, truncated, info))
        if terminated or truncated:
            break
    return seen


@pytest.mark.parametrize("action_type", ["discrete", "continuous"])
def test_an_episode_of_random_actions_stays_in_its_space_and_adds_up(env_id: str, action_type: str) -> None:
    env = gym.make(env_id, action_type=action_type, observe_style=True, **options(env_id))
    env.action_space.seed(3)
    seen = rollout(env, 3, [env.action_space.sample() for _ in range(100)])
    env.close()
    assert seen[-1][2] or seen[-1][3]
    for observation, *_ in seen:
        assert env.observation_space.contains(observation)
    for _, reward, terminated, _, info in seen[1:]:
        assert reward == pytest.approx(sum(info["reward_terms"].values()))
        assert info["cost"] == pytest.approx(sum(info["cost_terms"].values()))
        assert info["cost"] >= 0
        assert set(info["reward_terms"]) == {"progress", "comfort", "collision", "red"}
        assert terminated == (info["crashed"] or info["arrived"])


def test_same_seed_and_actions_give_the_same_bits(env_id: str) -> None:
    runs = []
    for _ in range(2):
        env = gym.make(env_id, action_type="continuous", **options(env_id))
        env.action_space.seed(7)
        runs.append(rollout(env, 11, [env.action_space.sample() for _ in range(40)]))
        env.close()
    first, second = runs
    assert len(first) == len(second)
    for a, b in zip(first, second, strict=True):
        assert a[0].tobytes() == b[0].tobytes()
    assert [step[1] for step in first[1:]] == [step[1] for step in second[1:]]


def test_two_environments_in_one_process_do_not_disturb_each_other(env_id: str) -> None:
    alone = gym.make(env_id, **options(env_id))
    expected = rollout(alone, 5, [3] * 15)
    alone.close()
    one, other = gym.make(env_id, **options(env_id)), gym.make(env_id, **options(env_id))
    other.reset(seed=99)
    observation, _ = one.reset(seed=5)
    assert np.array_equal(observation, expected[0][0])
    for step in expected[1:]:
        other.step(4)
        assert np.array_equal(one.step(3)[0], step[0])
    one.close()
    other.close()


def seen_styles(env: gym.Env[Any, Any], seed: int, crowd: dict[str, Any]) -> set[str]:
    """Styles of the first neighbours that come into sight in an episode, if anyone does."""
    _, info = env.reset(seed=seed, options=crowd)
    for _ in range(100):
        styles = {style for style in info["neighbours"]["style"] if style}
        if styles:
            return styles
        _, _, terminated, truncated, info = env.step(1)
        if terminated or truncated:
            break
    return set()


def test_the_crowd_changes_for_one_episode(env_id: str) -> None:
    env = gym.make(env_id)  # as it stands: with few cars nobody may come into sight
    episodes = (seen_styles(env, seed, {"styles": {"timid": 1.0}}) for seed in range(1, 7))
    styles = next((styles for styles in episodes if styles), set())
    assert styles == {"timid"}
    _, info = env.reset(seed=1, options={"population": "tdbm_spectrum"})
    assert info["episode"]["population"] == "tdbm_spectrum"
    _, info = env.reset(seed=1)
    assert info["episode"]["population"] == "naturalistic"
    env.close()


def test_what_does_not_exist_is_refused_with_the_nearest_name(env_id: str) -> None:
    for wrong, words in (
        ({"population": "naturalstic"}, "'naturalistic'"),
        ({"styles": {"timd": 1.0}}, "'timid'"),
        ({"scenario": "yelow_light"}, "'yellow_light'"),
        ({"config": {"duraton_s": 1.0}}, "'duration_s'"),
    ):
        with pytest.raises(InputError, match=words):
            gym.make(env_id, **wrong)
    env = gym.make(env_id, **options(env_id))
    with pytest.raises(InputError, match="'rare_heavy'"):
        env.reset(options={"population": "rare_hevy"})
    with pytest.raises(InputError, match="'styles'"):
        env.reset(options={"style": {"timid": 1.0}})
    env.close()


def test_frames_are_drawn_without_a_display(env_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    env = gym.make(env_id, render_mode="rgb_array", **options(env_id))
    env.reset(seed=2)
    frame = env.render()
    assert isinstance(frame, np.ndarray)
    assert frame.dtype == np.uint8
    assert frame.shape[2] == 3
    centre = frame[frame.shape[0] // 2, frame.shape[1] // 2]
    assert centre.max() < 60  # the ego is black, and in the middle
    assert len(np.unique(frame.reshape(-1, 3), axis=0)) > 10
    env.close()


def test_closing_twice_is_harmless_and_a_closed_one_says_so(env_id: str) -> None:
    env = gym.make(env_id, **options(env_id)).unwrapped
    env.close()
    env.reset(seed=0)
    env.close()
    env.close()
    with pytest.raises(InputError, match="reset"):
        env.step(1)
