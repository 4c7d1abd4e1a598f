"""Vector environments; the workers of AsyncVectorEnv are daemonic and, with spawn, import everything anew."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from stylesim.envs.registration import IDS, register
from stylesim.scenario import load_scenario

register()


class Maker:
    """Makes a quick environment; picklable, so that a spawned worker can call it."""

    def __init__(self, env_id: str) -> None:
        self.env_id = env_id

    def __call__(self) -> gym.Env[Any, Any]:
        register()
        scenario = load_scenario(IDS[self.env_id])
        if scenario.backend == "highway":
            few = scenario.model_copy(update={"options": {**scenario.options, "vehicles": 6}})
            return gym.make(self.env_id, scenario=few, config={"period_s": 0.2, "duration_s": 2.0})
        short = scenario.model_copy(update={"warm_up_s": 5.0 if "YellowLight" in self.env_id else 20.0})
        return gym.make(self.env_id, scenario=short, config={"duration_s": 2.0})


def played(envs: gym.vector.VectorEnv[Any, Any, Any]) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    observations, _ = envs.reset(seed=[3, 4])
    seen, rewards = [observations.copy()], []
    for _ in range(25):  # over the end of the episodes, so that they are reset
        observations, reward, _, _, infos = envs.step(np.array([3, 4]))
        seen.append(observations.copy())
        rewards.append(reward)
    envs.close()
    return np.array(seen), np.array(rewards), infos


@pytest.mark.slow
@pytest.mark.parametrize("env_id", sorted(IDS))
def test_sync_and_async_with_spawn_give_the_same(env_id: str) -> None:
    makers = [Maker(env_id)] * 2
    sync, sync_rewards, infos = played(SyncVectorEnv(makers))
    spawned, spawned_rewards, _ = played(AsyncVectorEnv(makers, context="spawn"))
    assert np.array_equal(sync, spawned)
    assert np.array_equal(sync_rewards, spawned_rewards)
    assert not np.array_equal(sync[:, 0], sync[:, 1])
    assert infos["neighbours"]["number"].shape == (2, 8)


def test_no_child_is_left_behind() -> None:
    import os

    def children() -> set[str]:
        found = set()
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = stat.read_text().rsplit(")", 1)[1].split()
            except OSError:  # that process has ended meanwhile
                continue
            if fields[1] == str(os.getpid()):
                found.add(stat.parent.name)
        return found

    before = children()
    envs = SyncVectorEnv([Maker("stylesim/YellowLight-v0")] * 2)
    envs.reset(seed=0)
    assert len(children() - before) == 2
    envs.close()
    assert not children() - before


@pytest.mark.slow
def test_make_vec_with_spawn() -> None:
    envs = gym.make_vec(
        "stylesim/YellowLight-v0",
        num_envs=2,
        vectorization_mode="async",
        vector_kwargs={"context": "spawn"},
        population="rare_heavy",
    )
    observations, _ = envs.reset(seed=0)
    assert envs.observation_space.contains(observations)
    envs.close()
