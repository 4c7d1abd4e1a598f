"""Generation against the bare `sumo` program: same network, demand, models and seed; log and corpus included.

    python -m benchmarks.generation [--runs 5] [--seconds 600] [--episodes 100]

Runs are interleaved (bare, SUMO's own Parquet output, stylesim). Times are CPU seconds (user and system, of the process
that does the work, all threads), since other work on the machine would otherwise count; scaling is in wall seconds.
Styles are on: wander, pedal noise and the decisions at the yellow. The stages show where the time beyond the bare
simulation goes; "prepare" draws the drivers and writes SUMO's files, which the bare program gets for nothing.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

from stylesim.corpus import write_part
from stylesim.population import Population
from stylesim.scenario import Scenario, load_scenario
from stylesim.simulation.generate import generate
from stylesim.simulation.sumo.episode import EpisodeFiles, prepare_episode, sumo_options
from stylesim.simulation.sumo.runner import SumoBackend
from stylesim.simulation.sumo.scenes import scene_of

TARGET_BYTES, TARGET_SCALING = 7.0, 1.8
TARGET_RATIO = "0.25 with styles on, 0.35 without"
PARQUET = ("--fcd-output.skip-empty", "--fcd-output.attributes", "x,y,angle,speed", "--precision", "3")


def bare(files: EpisodeFiles, *more: str) -> float:
    """CPU seconds of the bare program."""
    program = shutil.which("sumo") or str(Path(sys.executable).with_name("sumo"))
    before = os.times()
    subprocess.run([program, *sumo_options(files), *more], check=True, capture_output=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def ours(
    backend: SumoBackend, scenario: Scenario, crowd: Population, *, seed: int, folder: Path
) -> tuple[dict[str, float], int, int]:
    """Seconds of each stage, valid agent-frames, and bytes on disk of one episode."""
    marks = [time.process_time()]
    files = prepare_episode(scenario, crowd, seed=seed, episode=0, folder=folder)
    marks.append(time.process_time())
    log, decisions = backend.simulate(files)
    marks.append(time.process_time())
    scene = scene_of(log, decisions, files, name=scenario.name)
    marks.append(time.process_time())
    write_part(folder / "corpus", 0, [scene])
    marks.append(time.process_time())
    names = ("prepare", "simulate and log", "bodies and scene", "encode and write")
    size = sum(p.stat().st_size for p in (folder / "corpus").rglob("*") if p.is_file() and p.suffix != ".json")
    stages = {name: b - a for name, a, b in zip(names, marks, marks[1:], strict=False)}
    return stages, int(scene.tracks.valid.sum()), size


def against_bare(name: str, *, runs: int, seconds: float) -> None:
    """Print one scenario's table."""
    scenario = load_scenario(name).model_copy(update={"duration_s": seconds, "warm_up_s": 0.0})
    crowd = Population.load("tdbm_spectrum")
    backend = SumoBackend()
    times: dict[str, list[float]] = defaultdict(list)
    steps = size = 0
    for run in range(runs + 1):  # the first one warms caches and is not counted
        with tempfile.TemporaryDirectory() as text:
            folder = Path(text)
            files = prepare_episode(scenario, crowd, seed=100 + run, episode=0, folder=folder)
            plain = bare(files)
            own = bare(files, "--fcd-output", str(folder / "fcd.parquet"), *PARQUET)
            stages, steps, size = ours(backend, scenario, crowd, seed=100 + run, folder=folder)
        if run == 0:
            continue
        total = sum(stages.values())
        times["bare sumo, no output (s)"].append(plain)
        times["sumo with its Parquet output (s)"].append(own)
        times["stylesim, styles on, to disk (s)"].append(total)
        for stage, value in stages.items():
            times[f"  of that: {stage} (s)"].append(value)
        times[f"ratio sumo / stylesim (target {TARGET_RATIO})"].append(plain / total)
        times["ratio sumo / its own Parquet"].append(plain / own)
        times["stylesim, 1000 vehicle-steps per second"].append(steps / total / 1000)
        times[f"bytes per vehicle-step (target <= {TARGET_BYTES:g})"].append(size / steps)
    backend.close()
    print(f"\n{name}: {seconds:g} s at 0.1 s, {steps} vehicle-steps in the last run, n = {runs}")
    for label, values in times.items():
        print(f"  {label:60} {statistics.median(values):8.3f}   [{min(values):.3f} .. {max(values):.3f}]")


def scaling(name: str, *, episodes: int, runs: int) -> None:
    """Print wall times of the same request with one and two workers."""
    walls: dict[int, list[float]] = {1: [], 2: []}
    for run in range(runs):
        for workers, taken in walls.items():
            with tempfile.TemporaryDirectory() as folder:
                begin = time.perf_counter()
                generate(name, "tdbm_spectrum", episodes=episodes, seed=run, out=Path(folder) / "c", workers=workers)
                taken.append(time.perf_counter() - begin)
    ratios = [one / two for one, two in zip(walls[1], walls[2], strict=True)]
    print(f"\n{name}, {episodes} episodes, n = {runs}: 1 worker {statistics.median(walls[1]):.2f} s, ", end="")
    print(f"2 workers {statistics.median(walls[2]):.2f} s: x {statistics.median(ratios):.2f} ", end="")
    print(f"[{min(ratios):.2f} .. {max(ratios):.2f}] (target >= {TARGET_SCALING}, on a quiet machine)")


def main() -> None:
    """Print every table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--episodes", type=int, default=100)
    asked = parser.parse_args()
    for name in ("ramp_merge", "yellow_light"):
        against_bare(name, runs=asked.runs, seconds=asked.seconds)
    scaling("ramp_merge", episodes=asked.episodes, runs=max(3, asked.runs // 2))


if __name__ == "__main__":
    main()
