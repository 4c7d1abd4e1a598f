"""What `stylesim.populate` costs a user's own simulation: libsumo with and without it, and TraCI beside.

`python -m benchmarks.populate_cost [--rounds 5] [--seconds 120]`: the compiled network of `yellow_light`, flows of the
plain `sumo` kind with the types of `stylesim export sumo-vtypes`; all ways in turn, so that a busy machine slows
all alike; CPU time of this process (TraCI: wall time, because the other half is another process) per vehicle-step.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from stylesim.plugins.populate import SUMO_OPTIONS, populate
from stylesim.plugins.vtypes import export_vtypes
from stylesim.scenario import load_scenario
from stylesim.simulation.sumo.network import compiled_network, sumo_program
from stylesim.simulation.sumo.options import sumo_options_of

ARMS = {"west_in": "east_out", "east_in": "west_out", "south_in": "north_out", "north_in": "south_out"}
VEHICLES_PER_H = 600
WAYS = ("libsumo alone", "populate, no log", "populate", "traci alone", "populate by traci")


def prepared(folder: Path) -> list[str]:
    """Options of the simulation; its files are in the folder."""
    scenario = load_scenario("yellow_light")
    net = compiled_network(scenario, sumo_options_of(scenario), speed_limit_mps=16.667)
    types = export_vtypes("tdbm_spectrum", folder / "styles.add.xml")
    flows = "".join(
        f'<flow id="{start}" type="stylesim.tdbm_spectrum" from="{start}" to="{goal}" begin="0" end="3600"'
        f' vehsPerHour="{VEHICLES_PER_H}" departLane="best" departSpeed="max"/>'
        for start, goal in ARMS.items()
    )
    (folder / "flows.rou.xml").write_text(f"<routes>{flows}</routes>")
    files = ["-n", str(net), "-a", str(types), "-r", str(folder / "flows.rou.xml")]
    return [*files, *SUMO_OPTIONS, "--no-step-log", "--no-warnings", "--xml-validation", "never", "--seed", "3"]


def run(way: str, options: list[str], seconds: float) -> tuple[float, int]:
    """(microseconds per vehicle-step, vehicle-steps) of one run, in this process."""
    by_traci = "traci" in way
    os.environ.pop("LIBSUMO_AS_TRACI", None)
    sumo: Any = importlib.import_module("traci" if by_traci else "libsumo")
    sumo.start([str(sumo_program("sumo")) if by_traci else "sumo", *options])
    clock = time.perf_counter if by_traci else time.process_time
    crowd = populate(sumo, "tdbm_spectrum", 1, log="no log" not in way) if "populate" in way else None
    vehicle_steps = 0
    begin = clock()
    for _ in range(round(seconds / 0.1)):
        sumo.simulationStep()
        if crowd is not None:
            crowd.step()
        vehicle_steps += sumo.vehicle.getIDCount()
    used = clock() - begin
    sumo.close()
    return 1e6 * used / vehicle_steps, vehicle_steps


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--one", help=argparse.SUPPRESS)  # a run in a process of its own: way and options as JSON
    given = parser.parse_args()
    if given.one:
        print(*run(**json.loads(given.one), seconds=given.seconds))
        return
    found: dict[str, list[float]] = {way: [] for way in WAYS}
    steps = 0.0
    with tempfile.TemporaryDirectory() as folder:
        options = prepared(Path(folder))
        for _ in range(given.rounds):
            for way in WAYS:
                command = [sys.executable, "-m", "benchmarks.populate_cost", "--seconds", str(given.seconds)]
                task = json.dumps({"way": way, "options": options})
                done = subprocess.run([*command, "--one", task], capture_output=True, text=True, check=True)
                cost, steps = (float(value) for value in done.stdout.split()[-2:])
                found[way].append(cost)
    print(f"{given.rounds} rounds, {given.seconds:g} s simulated, {steps:.0f} vehicle-steps a run (the last one)")
    print("| way | µs per vehicle-step: median (least to most) | × libsumo alone |\n|---|---|---|")
    alone = median(found["libsumo alone"])
    for way, costs in found.items():
        print(f"| {way} | {median(costs):.1f} ({min(costs):.1f}-{max(costs):.1f}) | {median(costs) / alone:.2f} |")


if __name__ == "__main__":
    main()
