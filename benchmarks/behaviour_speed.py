"""What style behaviours cost: a run with them against plain libsumo stepping, same network, demand and models.

    python -m benchmarks.behaviour_speed [--scenarios motorway corridor] [--runs 3] [--seconds 300]

Both runs load the same files (same drivers, vehicle types, EIDM, `lanechange.duration`) in this process; "off" only
steps, "on" steps with everything that stylesim does for behaviour while SUMO runs: the wish for speed by the traffic
around, the decisions at the yellow, the solid line, missed turns, the lateral wander and the drivers' feet (both
computed after the run for every frame).
Logging is counted in neither; it has its own benchmark (`benchmarks.generation`). CPU seconds of this process, runs
interleaved, median and range. Target: <= 1.5.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import load_scenario
from stylesim.simulation.foot import footed
from stylesim.simulation.sumo.engine import Engine
from stylesim.simulation.sumo.episode import DT_S, EpisodeFiles, prepare_episode, sumo_options
from stylesim.simulation.sumo.flow import FlowSense
from stylesim.simulation.sumo.missing_turns import MissedTurns
from stylesim.simulation.sumo.stopzone import StopZone
from stylesim.simulation.sumo.yellow import YellowController
from stylesim.simulation.wander import lateral_wander

TARGET = 1.5


def plain(engine: Engine, files: EpisodeFiles) -> tuple[float, int]:
    """CPU seconds and vehicle-steps of stepping alone."""
    engine.load(sumo_options(files))
    begin, steps = time.process_time(), 0
    for _ in range(round(files.end_s / DT_S)):
        engine.step()
        steps += engine.sumo.vehicle.getIDCount()
    return time.process_time() - begin, steps


def styled(engine: Engine, files: EpisodeFiles) -> tuple[float, int]:
    """The same with behaviours."""
    engine.load(sumo_options(files))
    begin, steps = time.process_time(), 0
    behaviours = (
        FlowSense(engine.sumo, files),
        YellowController(engine.sumo, files),
        StopZone(engine.sumo, files),
        MissedTurns(engine.sumo, files),
    )
    for step in range(round(files.end_s / DT_S)):
        for behaviour in behaviours:
            behaviour.before_step(step)
        engine.step()
        steps += engine.sumo.vehicle.getIDCount()
    people = list(files.drivers.values())
    frames = max(1, round(steps / max(1, len(people))))
    speed, styles = np.full((len(people), frames), 20.0), [driver.style for driver in people]
    footed(
        styles,
        speed,
        dt_s=DT_S,
        streams=[stream(files.seed, files.episode, driver.driver_id, "pedal") for driver in people],
    )
    lateral_wander(
        styles,
        speed,
        limit_m=np.ones(len(people)),
        dt_s=DT_S,
        streams=[stream(files.seed, files.episode, driver.driver_id, "wander") for driver in people],
    )
    return time.process_time() - begin, steps


def main() -> None:
    """Run both in turn, print the ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", nargs="+", default=["motorway", "corridor"])
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=300.0)
    asked = parser.parse_args()
    engine = Engine()
    for name in asked.scenarios:
        scenario = load_scenario(name).model_copy(update={"duration_s": asked.seconds})
        ratios, off, on, steps = [], [], [], 0
        for run in range(asked.runs):
            with tempfile.TemporaryDirectory() as folder:
                files = prepare_episode(
                    scenario, Population.load("tdbm_spectrum"), seed=17 + run, episode=0, folder=Path(folder)
                )
                bare, steps = plain(engine, files)
                full, _ = styled(engine, files)
            off.append(bare)
            on.append(full)
            ratios.append(full / bare)
        print(
            f"{name}: {steps} vehicle-steps in the last of {asked.runs} runs; off {statistics.median(off):.2f} s, "
            f"on {statistics.median(on):.2f} s, ratio {statistics.median(ratios):.2f} "
            f"[{min(ratios):.2f}, {max(ratios):.2f}] (target <= {TARGET})"
        )
    engine.close()


if __name__ == "__main__":
    main()
