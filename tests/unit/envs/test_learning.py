"""Stable-Baselines3 learns on an id of each simulator without complaint (not: learns well)."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from stylesim.envs.registration import register

register()


@pytest.mark.slow
@pytest.mark.parametrize("env_id", ["stylesim/Highway-v0", "stylesim/YellowLight-v0"])
def test_ppo_runs(env_id: str, quick_options) -> None:
    ppo = pytest.importorskip("stable_baselines3").PPO
    env = gym.make(env_id, **quick_options[env_id])
    model = ppo("MlpPolicy", env, n_steps=64, batch_size=32, n_epochs=2, seed=0, device="cpu")
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(256)
    assert any(
        not np.array_equal(a.numpy(), b.detach().numpy())
        for a, b in zip(before, model.policy.parameters(), strict=True)
    )
    action, _ = model.predict(env.reset(seed=1)[0], deterministic=True)
    assert env.action_space.contains(int(action))
    env.close()
