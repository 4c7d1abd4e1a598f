"""The light of `hw_yellow_light` as the ego meets it."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from stylesim.envs.registration import register
from stylesim.signals import SignalState

register()


@pytest.mark.slow
def test_the_ego_sees_the_light_and_may_run_it() -> None:
    env = gym.make("stylesim/HwYellowLight-v0", config={"period_s": 0.5, "duration_s": 40.0}, render_mode="rgb_array")
    layout = env.unwrapped.layout
    seen, reds, distances = set(), 0, []
    for seed in range(12):
        env.reset(seed=seed)
        done = False
        while not done:
            observation, _, terminated, truncated, info = env.step(1)  # keeps its speed, whatever is shown
            done = terminated or truncated
            signal = layout.signal(observation)
            state = SignalState(int(np.argmax(signal[: len(SignalState)])))
            seen.add(state)
            if state in (SignalState.YELLOW, SignalState.RED):
                distances.append(float(signal[-2]))
            reds += info["ran_red"]
        if reds and {SignalState.GREEN, SignalState.YELLOW, SignalState.RED} <= seen:
            break
    assert env.unwrapped._world.picture().stop_lines_m.shape[0] >= 1
    env.close()
    assert {SignalState.GREEN, SignalState.YELLOW, SignalState.RED} <= seen
    assert min(distances) < 0.5
    assert reds >= 1
