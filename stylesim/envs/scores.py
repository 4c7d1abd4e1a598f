"""How simple egos score: the numbers of docs/environments.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from jaxtyping import Float64

from stylesim.envs.policies import policy
from stylesim.envs.registration import register

RESAMPLES = 2000  # chosen: a percentile of 2.5 % then rests on 50 resamples
MEASURES = ("return", "cost", "collision", "red", "speed_mps", "length_s")


@dataclass(frozen=True)
class Score:
    """Mean over episodes with the bootstrap 95 % interval of the mean; episodes are the units."""

    mean: float
    low: float
    high: float
    n: int


def score(
    env_id: str,
    ego: str,
    *,
    episodes: int,
    seed: int,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> Mapping[str, Score]:
    """Scores of one ego by measure: return, cost, share of episodes with a collision or a red run, mean speed, length.

    `options` go to `gymnasium.make`. InputError for an unknown ego.
    """
    register()
    env = gym.make(env_id, **options)
    try:
        rows = []
        for episode in range(episodes):
            rows.append(_episode(env, ego, seed=seed + episode))
            if progress is not None:
                progress(episode + 1, episodes)
    finally:
        env.close()
    table = np.array(rows)
    rng = np.random.default_rng(seed)
    return {name: _interval(table[:, i], rng) for i, name in enumerate(MEASURES)}


def _episode(env: gym.Env[Any, Any], ego: str, *, seed: int) -> tuple[float, ...]:
    act = policy(ego, env)
    env.action_space.seed(seed)
    observation, info = env.reset(seed=seed)
    total = cost = reds = 0.0
    speeds: list[float] = []
    over = False
    while not over:
        observation, reward, terminated, truncated, info = env.step(act(observation))
        total, cost, reds = total + float(reward), cost + info["cost"], reds + info["ran_red"]
        speeds.append(info["speed_mps"])
        over = terminated or truncated
    return total, cost, float(info["crashed"]), float(reds > 0), float(np.mean(speeds)), info["time_s"]


def _interval(values: Float64[np.ndarray, " episode"], rng: np.random.Generator) -> Score:
    means = values[rng.integers(len(values), size=(RESAMPLES, len(values)))].mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return Score(float(values.mean()), float(low), float(high), len(values))
