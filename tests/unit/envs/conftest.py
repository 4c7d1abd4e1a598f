"""Small, quick worlds for the environments' tests."""

from __future__ import annotations

from typing import Any

import pytest

from stylesim.envs.registration import register
from stylesim.scenario import Scenario, load_scenario

register()


def quick_yellow_light() -> Scenario:
    """The shipped crossing with a short warm-up."""
    return load_scenario("yellow_light").model_copy(update={"warm_up_s": 5.0})


def quick_highway() -> Scenario:
    """The shipped motorway with few cars."""
    scenario = load_scenario("highway")
    return scenario.model_copy(update={"options": {**scenario.options, "vehicles": 6}})


@pytest.fixture
def quick_options() -> dict[str, dict[str, Any]]:
    """What to give `gymnasium.make` for a quick environment, by id."""
    return {
        "stylesim/YellowLight-v0": {"scenario": quick_yellow_light()},
        "stylesim/Highway-v0": {"scenario": quick_highway(), "config": {"period_s": 0.2, "duration_s": 10.0}},
    }
