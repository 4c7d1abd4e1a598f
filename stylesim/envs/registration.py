"""The Gymnasium ids of stylesim."""

from __future__ import annotations

import gymnasium as gym

IDS = {
    "stylesim/YellowLight-v0": "stylesim.envs.yellow_light:YellowLightEnv",
    "stylesim/Highway-v0": "stylesim.envs.highway:HighwayEnv",
}


def register() -> None:
    """Make the ids known to `gymnasium.make`; what is registered already is left alone."""
    for name, entry_point in IDS.items():
        if name not in gym.registry:
            gym.register(id=name, entry_point=entry_point)
