"""Several controlled vehicles: PettingZoo's own tests, and what they do not look at."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from stylesim.envs import parallel_env
from stylesim.errors import InputError
from stylesim.scenario import load_scenario, scenarios

pytest.importorskip("pettingzoo")
QUICK = {"period_s": 0.5, "duration_s": 6.0}
OFTEN = ("highway", "ramp_merge")


def quick(name: str, **arguments: Any) -> Any:
    scenario = load_scenario(name)
    if scenario.backend == "sumo":
        scenario = scenario.model_copy(update={"warm_up_s": 25.0})
    return parallel_env(scenario, **{"config": QUICK, "population": "tdbm_spectrum", **arguments})


@pytest.mark.parametrize("name", [n if n in OFTEN else pytest.param(n, marks=pytest.mark.slow) for n in scenarios()])
@pytest.mark.filterwarnings("ignore:The old environment creation API:DeprecationWarning")
def test_pettingzoos_own_check_finds_nothing(name: str) -> None:
    from pettingzoo.test import parallel_api_test

    env = quick(name)
    parallel_api_test(env, num_cycles=60)
    env.close()


def test_same_seed_and_actions_give_the_same_bits() -> None:
    env = quick("ramp_merge", agents=2, action_type="continuous")
    runs = []
    for _ in range(2):
        observations, _ = env.reset(seed=5)
        run = [observations["car_0"].copy(), observations["car_1"].copy()]
        while env.agents:
            observations, rewards, *_ = env.step({agent: np.array([0.2, 0.0]) for agent in env.agents})
            run += [*observations.values(), np.array([*rewards.values()])]
        runs.append(run)
    env.close()
    assert len(runs[0]) == len(runs[1]) > 8
    assert all(np.array_equal(a, b) for a, b in zip(*runs, strict=True))


def test_the_controlled_vehicles_see_each_other_as_of_unknown_style() -> None:
    env = quick("motorway", agents=6, config={**QUICK, "neighbours": 64, "perception_m": 500.0})
    _, infos = env.reset(seed=2)
    seen = [info["neighbours"]["style"][: int((info["neighbours"]["number"] >= 0).sum())] for info in infos.values()]
    env.close()
    assert any("" in styles for styles in seen)
    for styles in seen:
        assert styles.count("") <= 5


@pytest.mark.slow
def test_who_collides_is_taken_off_the_road_and_the_others_go_on() -> None:
    env = quick("highway", agents=3, config={"period_s": 0.5, "duration_s": 15.0})
    for seed in range(8):  # until the one that only ever goes faster meets somebody
        env.reset(seed=seed)
        crashed_s: dict[str, float] = {}
        while env.agents:
            acting = list(env.agents)
            _, _, ended, cut, infos = env.step({agent: 3 if agent == "car_0" else 1 for agent in acting})
            for agent in acting:
                if infos[agent]["crashed"]:
                    crashed_s[agent] = infos[agent]["time_s"]
                    assert ended[agent]
                assert not (ended[agent] and cut[agent])
            last = max(info["time_s"] for info in infos.values())
        if "car_0" in crashed_s and len(crashed_s) < 3:
            break
    env.close()
    assert "car_0" in crashed_s
    assert last > crashed_s["car_0"]


def test_options_that_are_not_ours_are_named_and_misspelt_ones_refused() -> None:
    env = quick("highway", agents=1)
    _, infos = env.reset(seed=0, options={"curriculum": 3, "styles": {"timid": 1.0}})
    assert infos["car_0"]["episode"]["ignored_options"] == ("curriculum",)
    assert {style for style in infos["car_0"]["neighbours"]["style"] if style} == {"timid"}
    with pytest.raises(InputError, match="'population'"):
        env.reset(options={"populaton": "naturalistic"})
    env.close()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"agents": 0}, "from 1 to 32"),
        ({"population": "naturalstic"}, "'naturalistic'"),
        ({"config": {"entry": "yellow"}}, "one ego"),
        ({"render_mode": "human"}, "rgb_array"),
    ],
)
def test_what_does_not_fit_is_refused(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        parallel_env("yellow_light", **arguments)


def test_every_agent_needs_an_action_and_a_closed_environment_says_so() -> None:
    env = quick("highway", agents=2, render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().dtype == np.uint8
    with pytest.raises(InputError, match="'car_1'"):
        env.step({"car_0": 1})
    env.close()
    env.close()
    with pytest.raises(InputError, match="reset"):
        env.step({})


def test_too_few_drivers_is_an_error_of_the_simulation_not_of_the_process() -> None:
    from stylesim.errors import SimulationError

    scenario = load_scenario("highway")
    few = scenario.model_copy(update={"options": {**scenario.options, "vehicles": 2}})
    env = parallel_env(few, agents=3)
    with warnings.catch_warnings(), pytest.raises(SimulationError, match="3 are to be taken over"):
        env.reset(seed=0)
    env.close()
