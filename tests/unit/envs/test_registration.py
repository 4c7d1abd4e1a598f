import subprocess
import sys

import gymnasium as gym

from stylesim.envs.registration import IDS, env_id, register


def test_registering_twice_changes_nothing() -> None:
    register()
    before = {name: gym.registry[name] for name in IDS}
    register()
    assert before == {name: gym.registry[name] for name in IDS}
    assert all(isinstance(spec.entry_point, str) for spec in before.values())


def test_registering_loads_no_simulator() -> None:
    code = (
        "import sys; from stylesim.envs.registration import register; register();"
        "print([m for m in ('libsumo', 'highway_env', 'pygame', 'torch', 'matplotlib', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_ids_are_the_scenarios_in_camel_case() -> None:
    assert env_id("stop_and_go") == "stylesim/StopAndGo-v0"
    assert IDS["stylesim/YellowLight-v0"] == "yellow_light"
    assert IDS["stylesim/Highway-v0"] == "highway"
