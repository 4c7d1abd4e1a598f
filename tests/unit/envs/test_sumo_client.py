import contextlib
import math
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from stylesim.envs.config import EnvConfig
from stylesim.envs.sumo_client import SumoWorld
from stylesim.envs.world import EgoCommand
from stylesim.errors import InputError, SimulationError
from stylesim.population import Population
from stylesim.scenario import load_scenario

COAST = EgoCommand(0.0, float("nan"), 0)


def started(config: EnvConfig | None = None) -> SumoWorld:
    world = SumoWorld(config or EnvConfig(entry="yellow"))
    scenario = load_scenario("yellow_light").model_copy(update={"warm_up_s": 2.0})
    world.reset(scenario=scenario, population=Population.load("naturalistic"), seed=1)
    return world


def alive(pid: int) -> bool:
    """Is there such a process that is not a zombie."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    return False


def gone_soon(pid: int) -> bool:
    deadline = time.monotonic() + 15
    while alive(pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not alive(pid)


def test_closing_ends_the_child_and_leaves_no_zombie() -> None:
    world = started()
    pid = world.pid
    assert pid is not None
    assert alive(pid)
    world.close()
    world.close()
    assert not Path(f"/proc/{pid}").exists()
    assert world.pid is None


def test_a_forgotten_world_ends_its_child_too() -> None:
    world = started()
    pid = world.pid
    del world
    assert pid is not None
    assert not Path(f"/proc/{pid}").exists()


def test_a_dead_child_is_reported_and_replaced_at_the_next_reset() -> None:
    world = started()
    assert world.pid is not None
    os.kill(world.pid, signal.SIGKILL)
    with pytest.raises(SimulationError, match="has died"):
        world.step([COAST])
    scenario = load_scenario("yellow_light").model_copy(update={"warm_up_s": 2.0})
    (again,) = world.reset(scenario=scenario, population=Population.load("naturalistic"), seed=1)
    assert again.ego.speed_mps > 5
    world.close()


def test_errors_of_the_child_come_back_as_what_they_are_and_it_lives_on() -> None:
    world = started()
    pid = world.pid
    with pytest.raises(InputError, match="no traffic light"):
        world.reset(scenario=load_scenario("ramp_merge"), population=Population.load("naturalistic"), seed=1)
    assert world.pid == pid
    with pytest.raises(SimulationError, match="reset"):
        world.step([COAST])
    world.close()


PARENT = """
    import sys, time
    import gymnasium as gym
    from stylesim.envs.registration import register
    register()
    env = gym.make("stylesim/YellowLight-v0").unwrapped
    env.reset(seed=0)
    print(env._world.pid, flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="uses /proc and SIGKILL")
def test_the_child_ends_with_its_killed_parent() -> None:
    with subprocess.Popen([sys.executable, "-c", textwrap.dedent(PARENT)], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        assert alive(pid)
        parent.kill()
    assert gone_soon(pid)


def test_the_ego_can_stop_run_red_and_collide() -> None:
    outcomes = {"stopped": False, "red": False, "collided": False}
    shipped = load_scenario("yellow_light")
    dense = shipped.parameters["demand_vph"].model_copy(update={"low": 2400.0, "high": 2800.0})  # somebody to hit
    scenario = shipped.model_copy(update={"warm_up_s": 90.0, "parameters": shipped.parameters | {"demand_vph": dense}})
    world = SumoWorld(EnvConfig(entry="yellow", period_s=0.2, onset_tts_s=(4.5, 6.0)))
    for seed in range(12):
        world.reset(scenario=scenario, population=Population.load("naturalistic"), seed=seed)
        for _ in range(40):  # brakes at once
            (snapshot,) = world.step([EgoCommand(-4.0, float("nan"), 0)])
        outcomes["stopped"] |= snapshot.ego.speed_mps == 0.0
        world.reset(scenario=scenario, population=Population.load("naturalistic"), seed=seed)
        for _ in range(100):  # drives on whatever comes
            (snapshot,) = world.step([COAST])
            outcomes["red"] |= snapshot.ego.reds_run > 0
            outcomes["collided"] |= snapshot.ego.collided > 0
        if all(outcomes.values()):
            break
    world.close()
    assert outcomes == {"stopped": True, "red": True, "collided": True}


def test_the_onset_of_yellow_comes_when_it_was_drawn_to_come() -> None:
    world = SumoWorld(EnvConfig(entry="yellow", onset_tts_s=(3.0, 3.0), approach_s=2.0))
    scenario = load_scenario("yellow_light").model_copy(update={"warm_up_s": 2.0})
    (first,) = world.reset(scenario=scenario, population=Population.load("naturalistic"), seed=4)
    states, tts = [], []
    for _ in range(30):
        (snapshot,) = world.step([COAST])
        states.append(snapshot.ego.signal_state)
        tts.append(snapshot.ego.stop_line_m / snapshot.ego.speed_mps)
    world.close()
    onset = states.index(3.0)
    assert first.ego.signal_state == 2.0
    assert states[:onset] == [2.0] * onset
    assert tts[onset] == pytest.approx(3.0, abs=0.15)
    assert (onset + 1) * 0.1 == pytest.approx(2.0, abs=0.15)


def test_a_lane_change_takes_the_ego_to_the_next_lane_and_no_further() -> None:
    world = SumoWorld(EnvConfig(entry="yellow", approach_s=6.0, onset_tts_s=(4.0, 4.0)))
    scenario = load_scenario("yellow_light").model_copy(update={"warm_up_s": 2.0})
    for seed in range(12):  # until the ego starts on the right lane of the main road
        (first,) = world.reset(scenario=scenario, population=Population.load("naturalistic"), seed=seed)
        if first.ego.lanes_left == 1:
            break
    for _ in range(60):
        (snapshot,) = world.step([EgoCommand(0.0, float("nan"), 1)])
        if snapshot.ego.collided:
            break
    world.close()
    moved = snapshot.pose[0, :2] - first.pose[0, :2]
    left = -math.sin(first.pose[0, 4]) * moved[0] + math.cos(first.pose[0, 4]) * moved[1]
    assert snapshot.ego.lanes_left == 0
    assert left == pytest.approx(3.5, abs=0.6) or snapshot.ego.collided


@pytest.mark.slow
def test_the_ego_finds_room_in_a_crowd_that_queues_back() -> None:
    scenario = load_scenario("yellow_light")
    demand = scenario.parameters["demand_vph"].model_copy(update={"low": 5000.0, "high": 5000.0})
    dense = scenario.model_copy(update={"parameters": {**scenario.parameters, "demand_vph": demand}})
    world = SumoWorld(EnvConfig(entry="yellow"))
    for seed in range(8):
        (first,) = world.reset(scenario=dense, population=Population.load("naturalistic"), seed=seed)
        assert not first.ego.collided
        assert not world.step([EgoCommand(-3.0, float("nan"), 0)])[0].ego.collided
    world.close()
