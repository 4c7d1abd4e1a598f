"""Steps per second of the environments with 1 and 2 workers, against stock highway-env (and sumo-rl, if installed).

`python benchmarks/environment_speed.py` prints a table of medians with their spread (least to most) over repeats
that are interleaved, so that a busy machine slows all rows alike. Every row takes IDLE (action 1) and resets where an
episode ends; time in resets counts in "steps/s" and is left out of "ms/step", which one worker's row gives. The third
column says how much traffic a second of wall time buys: simulated seconds per second.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import numpy as np

from stylesim.envs.registration import register
from stylesim.scenario import Scenario, load_scenario

DENSE_VPH = 4200.0  # gives about 100 vehicles on the shipped crossing


@dataclass
class Row:
    """One line of the table."""

    name: str
    make: Callable[[], Any]
    workers: int
    period_s: float
    steps: int
    rates: list[float] = field(default_factory=list)
    step_ms: list[float] = field(default_factory=list)
    vehicles: list[float] = field(default_factory=list)


def dense_crossing() -> Scenario:
    scenario = load_scenario("yellow_light")
    demand = scenario.parameters["demand_vph"].model_copy(update={"low": DENSE_VPH, "high": DENSE_VPH})
    return scenario.model_copy(update={"parameters": {**scenario.parameters, "demand_vph": demand}})


def make_yellow() -> gym.Env[Any, Any]:
    register()
    return gym.make("stylesim/YellowLight-v0")


def make_dense() -> gym.Env[Any, Any]:
    register()
    return gym.make("stylesim/YellowLight-v0", scenario=dense_crossing())


def make_highway() -> gym.Env[Any, Any]:
    register()
    return gym.make("stylesim/Highway-v0")


def make_stock() -> gym.Env[Any, Any]:
    import highway_env  # noqa: F401 - registers highway-v0

    return gym.make("highway-v0", config={"vehicles_count": 30, "lanes_count": 3, "simulation_frequency": 20})


def measure(row: Row, seed: int) -> None:
    """One repeat: `row.steps` steps of each worker."""
    if row.workers == 1:
        rate, durations, vehicles = _single(row, seed)
        row.step_ms.append(float(np.median(durations)) * 1e3)
        row.vehicles += vehicles
    else:
        envs = gym.vector.AsyncVectorEnv([row.make] * row.workers, context="spawn")
        envs.reset(seed=seed)
        begin = time.perf_counter()
        for _ in range(row.steps):
            envs.step(np.ones(row.workers, np.int64))
        rate = row.steps * row.workers / (time.perf_counter() - begin)
        envs.close()
    row.rates.append(rate)


def _single(row: Row, seed: int) -> tuple[float, list[float], list[float]]:
    env = row.make()
    env.reset(seed=seed)
    durations, vehicles = [], []
    begin = time.perf_counter()
    for step in range(row.steps):
        before = time.perf_counter()
        _, _, terminated, truncated, info = env.step(1)
        durations.append(time.perf_counter() - before)
        vehicles.append(float(info.get("vehicles", np.nan)))
        if terminated or truncated:
            env.reset(seed=seed + step + 1)
    rate = row.steps / (time.perf_counter() - begin)
    env.close()
    return rate, durations, vehicles


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    warnings.filterwarnings("ignore", category=DeprecationWarning)
    rows = [
        Row("stylesim/YellowLight-v0", make_yellow, 1, 0.1, 1500),
        Row("stylesim/YellowLight-v0", make_yellow, 2, 0.1, 1500),
        Row("stylesim/YellowLight-v0, 4200 veh/h", make_dense, 1, 0.1, 800),
        Row("stylesim/Highway-v0 (30 cars, 20 Hz)", make_highway, 1, 1.0, 60),
        Row("stylesim/Highway-v0 (30 cars, 20 Hz)", make_highway, 2, 1.0, 60),
        Row("highway-v0, stock (30 cars, 3 lanes, 20 Hz)", make_stock, 1, 1.0, 60),
        Row("highway-v0, stock (30 cars, 3 lanes, 20 Hz)", make_stock, 2, 1.0, 60),
    ]
    for repeat in range(chosen.repeats):
        for row in rows:
            measure(row, chosen.seed + 1000 * repeat)
    print("| id | workers | steps/s | simulated s/s | ms/step | vehicles |\n|---|---|---|---|---|---|")
    for row in rows:
        rate, ms = _spread(row.rates, 0), _spread(row.step_ms, 2) if row.step_ms else "-"
        seen = f"{np.mean(row.vehicles):.0f}" if row.vehicles and np.isfinite(row.vehicles).all() else "-"
        print(f"| {row.name} | {row.workers} | {rate} | {np.median(row.rates) * row.period_s:.0f} | {ms} | {seen} |")


def _spread(values: list[float], digits: int) -> str:
    return f"{np.median(values):.{digits}f} ({min(values):.{digits}f}-{max(values):.{digits}f})"


if __name__ == "__main__":
    main()
