"""Compares ways to log a SUMO episode: time per vehicle-step of each, interleaved, relative to stepping alone.

    python -m benchmarks.logging_ways [--runs 5] [--duration 300]

The results are written down in docs/logging.md.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.simulation.sumo.engine import Engine
from stylesim.simulation.sumo.episode import EpisodeFiles, prepare_episode, sumo_options
from stylesim.simulation.sumo.recorder import Recorder

Step = Callable[[int], None]


def _nothing(sumo: Any) -> Step:
    return lambda step: None


def _getters(*names: str, listed: bool = False, raw: bool = False) -> Callable[[Any], Step]:
    """Getter calls per vehicle; `listed` asks SUMO for the list of vehicles each step."""

    def prepare(sumo: Any) -> Step:
        calls = [_raw(name) if raw else getattr(sumo.vehicle, name) for name in names]
        here: dict[str, None] = {}
        kept: list[Any] = []

        def after(step: int) -> None:
            if listed:
                ids: Any = sumo.vehicle.getIDList()
            else:
                here.update(dict.fromkeys(sumo.simulation.getDepartedIDList()))
                for name in sumo.simulation.getArrivedIDList():
                    here.pop(name, None)
                ids = list(here)
            for call in calls:
                kept.append(list(map(call, ids)))
            if len(kept) >= 800:
                flat = [list(chain.from_iterable(v)) if v and isinstance(v[0], tuple) else v for v in kept]
                np.fromiter(chain.from_iterable(flat), np.float64)
                kept.clear()

        return after

    return prepare


def _raw(name: str) -> Any:
    """The extension's own function, without libsumo's Python wrapper (private to libsumo)."""
    from libsumo import libsumo

    return getattr(libsumo._libsumo, f"vehicle_{name}")


def _recorder(sumo: Any) -> Step:
    return Recorder(sumo, signals=("centre",), first_step=0).after_step


def _subscriptions(sumo: Any) -> Step:
    variables = [0x42, 0x43, 0x40]  # position, angle, speed
    kept: list[Any] = []

    def after(step: int) -> None:
        for name in sumo.simulation.getDepartedIDList():
            sumo.vehicle.subscribe(name, variables)
        kept.append(sumo.vehicle.getAllSubscriptionResults())
        if len(kept) >= 400:
            kept.clear()

    return after


def _context(sumo: Any) -> Step:
    sumo.junction.subscribeContext("centre", 0xA4, 1000.0, [0x42, 0x43, 0x40])
    kept: list[Any] = []

    def after(step: int) -> None:
        kept.append(sumo.junction.getContextSubscriptionResults("centre"))
        if len(kept) >= 400:
            kept.clear()

    return after


def _output(kind: str, *more: str) -> Callable[[str], list[str]]:
    return lambda folder: ["--fcd-output", f"{folder}/fcd.{kind}", "--fcd-output.skip-empty", "--precision", "3", *more]


def _no_options(folder: str) -> list[str]:
    return []


READ_BACK = "SUMO's Parquet, x y posLat, read back"
WAYS: dict[str, tuple[Callable[[Any], Step], Callable[[str], list[str]]]] = {
    "stepping alone": (_nothing, _no_options),
    "the recorder (2 getters, events, signal)": (_recorder, _no_options),
    "2 getters": (_getters("getPosition", "getLateralLanePosition"), _no_options),
    "2 getters, list of vehicles each step": (
        _getters("getPosition", "getLateralLanePosition", listed=True),
        _no_options,
    ),
    "2 getters without Python wrappers": (
        _getters("getPosition", "getLateralLanePosition", raw=True),
        _no_options,
    ),
    "5 getters": (
        _getters("getPosition", "getAngle", "getSpeed", "getLanePosition", "getLateralLanePosition"),
        _no_options,
    ),
    "subscriptions": (_subscriptions, _no_options),
    "context subscription": (_context, _no_options),
    "SUMO's Parquet, all attributes": (_nothing, _output("parquet")),
    "SUMO's Parquet, x y": (_nothing, _output("parquet", "--fcd-output.attributes", "x,y")),
    READ_BACK: (_nothing, _output("parquet", "--fcd-output.attributes", "x,y,posLat")),
    "SUMO's CSV, x y": (_nothing, _output("csv", "--fcd-output.attributes", "x,y")),
    "SUMO's XML, x y": (_nothing, _output("xml", "--fcd-output.attributes", "x,y")),
}


def measure(engine: Engine, files: EpisodeFiles, way: str, folder: str) -> tuple[float, int]:
    """CPU seconds of one run (other work on the machine does not count), its files closed, and its vehicle-steps."""
    prepare, options = WAYS[way]
    engine.close()
    engine.load([*sumo_options(files), *options(folder)])
    after, count = prepare(engine.sumo), engine.sumo.vehicle.getIDCount
    steps, begin = 0, time.process_time()
    for step in range(round(files.end_s * 10)):
        engine.step()
        after(step)
        steps += count()
    engine.close()
    if way == READ_BACK:
        table = pl.read_parquet(f"{folder}/fcd.parquet")
        table.with_columns(pl.col("vehicle_id").cast(pl.Categorical).to_physical()).to_numpy()
    return time.process_time() - begin, steps


def main() -> None:
    """Runs every way in turn, several times, and prints medians and ranges."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--duration", type=float, default=300.0)
    chosen = parser.parse_args()
    scenario = load_scenario("yellow_light").model_copy(update={"duration_s": chosen.duration})
    taken: dict[str, list[float]] = {way: [] for way in WAYS}
    with tempfile.TemporaryDirectory() as folder:
        files = prepare_episode(scenario, Population.load("tdbm_spectrum"), seed=5, episode=0, folder=Path(folder))
        engine, total = Engine(), 0
        for _ in range(chosen.runs):
            for way, times in taken.items():
                seconds, total = measure(engine, files, way, folder)
                times.append(seconds)
    print(f"{total} vehicle-steps, {chosen.runs} interleaved runs; CPU time per vehicle-step")
    for way, times in taken.items():
        ratios = [own / base for own, base in zip(times, taken["stepping alone"], strict=True)]
        low, middle, high = np.quantile(ratios, [0.25, 0.5, 0.75])
        us = 1e6 * statistics.median(times) / total
        print(
            f"{way:42s} {us:5.2f} us (least {1e6 * min(times) / total:5.2f})   x {middle:.2f} ({low:.2f} to {high:.2f})"
        )


if __name__ == "__main__":
    main()
