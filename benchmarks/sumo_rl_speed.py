"""sumo-rl on the network and demand of `yellow_light`, to hold the environments' speed against.

sumo-rl controls the light, not a car, and steps SUMO by 1 s where we step by 0.1 s: compare SUMO steps per second.
Install it beside (`pip install --no-deps --target DIR sumo-rl pettingzoo`), then
`PYTHONPATH=DIR python benchmarks/sumo_rl_speed.py [--libsumo]`.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.simulation.sumo.episode import prepare_episode

DELTA_S, DURATION_S = 5, 600


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--libsumo", action="store_true", help="in process instead of by socket")
    parser.add_argument("--repeats", type=int, default=5)
    chosen = parser.parse_args()
    if chosen.libsumo:
        os.environ["LIBSUMO_AS_TRACI"] = "1"
    spec = find_spec("sumo")
    assert spec is not None
    assert spec.submodule_search_locations
    os.environ.setdefault("SUMO_HOME", spec.submodule_search_locations[0])
    import sumo_rl

    rates = []
    scenario = load_scenario("yellow_light").model_copy(update={"duration_s": float(DURATION_S)})
    for repeat in range(chosen.repeats):
        with tempfile.TemporaryDirectory() as folder:
            files = prepare_episode(
                scenario, Population.load("naturalistic"), seed=repeat, episode=0, folder=Path(folder)
            )
            env = sumo_rl.SumoEnvironment(
                net_file=str(files.network_path),
                route_file=str(files.route_path),
                single_agent=True,
                num_seconds=DURATION_S,
                delta_time=DELTA_S,
                yellow_time=3,
                sumo_warnings=False,
            )
            env.reset(seed=repeat)
            steps, begin, over = 0, time.perf_counter(), False
            while not over:
                _, _, terminated, truncated, _ = env.step(env.action_space.sample())
                steps, over = steps + 1, terminated or truncated
            rates.append(steps * DELTA_S / (time.perf_counter() - begin))
            env.close()
    way = "libsumo" if chosen.libsumo else "TraCI"
    print(
        f"\nsumo-rl by {way}: {np.median(rates):.0f} ({min(rates):.0f}-{max(rates):.0f}) SUMO steps of 1 s per second"
    )


if __name__ == "__main__":
    main()
