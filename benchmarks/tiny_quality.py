"""Quality of `tiny` on recordings with 100 drivers or more: against constant velocity and a fan of six arcs.

    python -m benchmarks.tiny_quality [--data ../shared/data] [--out runs/tiny_quality] [--seeds 0 1] [--only dlr_ut]

Each recording is cut into five blocks that share no driver (`recording_blocks`). One model is trained for all of them,
drawing from each equally often: every block is the test block once, the next one chooses the epoch, the other three are
trained on, so that each driver is forecast by models that never saw him. The kinematic fan is fitted on the same three
blocks of the recording that it is asked of. Windows of 2 s + 6 s, every second. A driver counts with the
mean of his windows in which he moves (1 m or more in the future); standing ones are reported apart. Differences are
relative, paired by driver and seed; intervals resample blocks, drivers in them, and seeds. All are within one site.

What is finished stays in OUT and is not run again. Times are CPU seconds of one thread.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import stylesim.forecasting  # noqa: F401 - before torch, since it sets how torch's threads wait

# isort: split
import numpy as np
import polars as pl
import torch

from benchmarks.recording_blocks import BLOCKS, RECORDINGS, SPEC, Recording, blocks_corpus, fold
from stylesim.corpus import Corpus
from stylesim.corpus.files import write_whole
from stylesim.evaluation.asking import ask
from stylesim.evaluation.metrics import MODES
from stylesim.evaluation.seeded import seeded_difference
from stylesim.forecast import Forecaster
from stylesim.forecasting.baselines import ConstantVelocity
from stylesim.forecasting.fan import KinematicFan
from stylesim.forecasting.training import train

TARGET = -0.15  # at least so much less error than the baseline
MOST_MIN = 15.0  # minutes to the plateau, two cores


def errors(forecaster: Forecaster, corpus: Corpus) -> list[dict[str, Any]]:
    """Per driver of the test split: means over the windows in which he moves, and over those in which he stands."""
    windows, _ = ask(forecaster, corpus.split("test"), spec=SPEC, modes=MODES, batch=16)
    keys, names = ["unit_id", "agent_id", "standing"], ["min_fde_m", "top_fde_m", "brier_fde_m", "miss_rate"]
    return (
        windows.group_by(keys).agg(pl.len().alias("windows"), *(pl.col(n).mean() for n in names)).sort(keys).to_dicts()
    )


def one_run(
    corpus: Corpus, asked: list[Recording], out: Path, *, seed: int, cache: Path, options: dict[str, Any]
) -> dict[str, Any]:
    """Train and test one fold; what it cost and the errors of the drivers of each recording."""
    wall, cpu = time.perf_counter(), time.process_time()
    model = train(corpus, size="tiny", spec=SPEC, seed=seed, out=out, cache=cache, accelerator="cpu", **options)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    curve = model.training_curve
    best = min(curve, key=lambda epoch: epoch["min_fde_m"])
    found = {}
    for recording in asked:
        mine = recording.of(corpus)
        fan = KinematicFan().fit(mine.split("train"), SPEC)
        found[recording.name] = {f.name: errors(f, mine) for f in (model, ConstantVelocity(), fan)}
    return {
        "cpu_s": cpu, "wall_s": wall, "load": os.getloadavg()[0], "epochs": len(curve), "steps": curve[-1]["step"],
        "best_epoch": best["epoch"], "best_step": best["step"], "curve": [e["min_fde_m"] for e in curve],
        "errors": found,
    }  # fmt: skip


def paired(
    runs: Iterable[dict[str, Any]], recording: str, name: str, metric: str, *, standing: bool
) -> dict[str, np.ndarray]:
    """{driver: values by seed} of one forecaster."""
    found: dict[tuple[str, str], dict[int, float]] = {}
    for run in runs:
        for row in run["errors"][recording][name]:
            if row["standing"] == standing:
                found.setdefault((row["unit_id"], row["agent_id"]), {})[run["seed"]] = row[metric]
    return {"/".join(key): np.array([by_seed[s] for s in sorted(by_seed)]) for key, by_seed in sorted(found.items())}


def compared(runs: list[dict[str, Any]], recording: str, other: str, metric: str, *, standing: bool = False) -> str:
    """One comparison of `tiny` with a baseline as text."""
    ours, theirs = (paired(runs, recording, name, metric, standing=standing) for name in ("tiny", other))
    if not ours:
        return "no driver"
    a, b = (np.stack([side[key] for key in ours], axis=1) for side in (ours, theirs))
    units = ["/".join(key.split("/")[:2]) for key in ours]
    change = seeded_difference(a, b, units, seed=0, purpose=f"{recording} {other} {metric} {standing}", relative=True)
    size = f"n = {len(ours)} drivers, {len(set(units))} blocks, {len(a)} seeds"
    text = f"{a.mean():6.2f} m against {b.mean():6.2f} m, {size}"
    if change.refused:
        return f"{text}: too few drivers for an interval"
    reached = "" if standing else f"  target {TARGET:+.0%}: {'reached' if change.value <= TARGET else 'missed'}"
    return f"{text}: {change.value:+.1%} [{change.low:+.1%}, {change.high:+.1%}]{reached}"


def report(runs: list[dict[str, Any]], asked: list[Recording]) -> None:
    """The tables, of the blocks that every seed has tested."""
    seeds = sorted({run["seed"] for run in runs})
    whole = [n for n in range(BLOCKS) if sum(run["fold"] == n for run in runs) == len(seeds)]
    runs = [run for run in runs if run["fold"] in whole]
    if not runs:
        print(f"no block was tested with every seed of {seeds} yet")
        return
    for name in (recording.name for recording in asked):
        print(name)
        for other, metric in (("constant_velocity", "top_fde_m"), ("kinematic_fan", "min_fde_m")):
            print(f"  {metric} against {other}: {compared(runs, name, other, metric)}")
            print(f"    standing: {compared(runs, name, other, metric, standing=True)}")
    cpu = [run["cpu_s"] for run in runs]
    print(
        f"one training, compiling included: {np.median(cpu):.0f} [{min(cpu):.0f} .. {max(cpu):.0f}] CPU s of one "
        f"thread, {np.median([r['steps'] for r in runs]):.0f} steps, best after "
        f"{np.median([r['best_step'] for r in runs]):.0f}, n = {len(runs)}; target {MOST_MIN:g} min on two cores",
        flush=True,
    )


def main() -> None:
    """Run what is missing and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--out", type=Path, default=Path("runs/tiny_quality"))
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--folds", type=int, nargs="+", default=list(range(BLOCKS)))
    parser.add_argument("--only", nargs="+", default=[r.name for r in RECORDINGS])
    parser.add_argument("--steps", type=int, default=1200)
    parser.add_argument("--options", type=json.loads, default={}, help="JSON: further options of `train`")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    asked.out.mkdir(parents=True, exist_ok=True)
    recordings = [r for r in RECORDINGS if r.name in asked.only]
    options = {"max_steps": asked.steps, "epochs": asked.steps, **asked.options}
    with tempfile.TemporaryDirectory() as folder:
        corpus = blocks_corpus(recordings, asked.data, Path(folder) / "corpus")
        for seed in asked.seeds:
            for number in asked.folds:
                file = asked.out / f"seed{seed}-fold{number}.json"
                if file.exists():
                    continue
                out = Path(folder) / "model"
                run = one_run(
                    fold(corpus, number), recordings, out, seed=seed, cache=Path(folder) / "cache", options=options
                )
                shutil.rmtree(out)
                write_whole(file, json.dumps({"fold": number, "seed": seed, **run}).encode())
    report([json.loads(file.read_bytes()) for file in sorted(asked.out.glob("seed*.json"))], recordings)


if __name__ == "__main__":
    main()
