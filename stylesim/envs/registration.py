"""The Gymnasium ids of stylesim: one for every scenario of the catalogue."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

from stylesim.scenario import scenarios

OWN = {  # scenarios whose environment differs from the catalogue's
    "yellow_light": "stylesim.envs.yellow_light:YellowLightEnv",
    "highway": "stylesim.envs.highway:HighwayEnv",
}
CATALOGUE = "stylesim.envs.catalogue:scenario_env"


def env_id(scenario: str) -> str:
    """`ramp_merge` as `stylesim/RampMerge-v0`."""
    return f"stylesim/{''.join(word.capitalize() for word in scenario.split('_'))}-v0"


IDS: dict[str, str] = {env_id(name): name for name in scenarios()}  # id -> scenario


def register() -> None:
    """Make the ids known to `gymnasium.make`; what is registered already is left alone."""
    for name, scenario in IDS.items():
        if name not in gym.registry:
            own = OWN.get(scenario)
            arguments: dict[str, Any] = {} if own else {"scenario": scenario}
            gym.register(id=name, entry_point=own or CATALOGUE, kwargs=arguments)
