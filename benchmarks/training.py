"""Training and prediction of the `tiny` forecaster: samples per second, what the loop costs, ms per scene.

    python -m benchmarks.training [CORPUS] [--repeats 20] [--threads 2]

Without a merged CORPUS the scenes are made here: 96 drivers on 40 parallel lanes of 50 m in six scenes of 20 s, so
that every sample has 16 agents and 64 polylines of 10 points. Times are wall seconds, since the network runs on all
threads, and CPU seconds of all of them: on a busy machine look at the CPU time, at the best of the wall times, and at
the load average that is printed. "Loop" is what a step of `Loop` takes outside the batch, the network, the loss, its
gradient and the optimizer; the anchors count for it. "Collate" is from the store to the tensors of the network, one
thread. The store is compared with the corpus on disk (compressed) and with its tracks as plain float32 arrays.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import stylesim.forecasting  # noqa: F401 - before torch, since it sets how torch's threads wait

# isort: split
import numpy as np
import torch

from benchmarks.labelling import motorway
from stylesim.corpus import Corpus, CorpusWriter
from stylesim.forecast import ForecastTask
from stylesim.forecasting.config import InputConfig, model_config
from stylesim.forecasting.data import TrainingData
from stylesim.forecasting.devices import runtime
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.loop import Loop, TrainSettings
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.objective import mixture_loss, responsible_query
from stylesim.forecasting.samples import compiled, windows
from stylesim.windows import WindowSpec

SPEC = WindowSpec()
BATCH, STEPS, DRIVERS = 32, 8, 32
SPLIT = ("train", "train", "train", "train", "train", "val")
TARGETS = {
    "samples/s": ">= 350",
    "loop, ms per step": "<= 1",
    "predict, ms": "<= 10",
    "collate, samples/s per core": ">= 2000",
    "store / corpus on disk": "<= 1.2",
}
FRAME_BYTES = 6 * 4  # of an agent: position, velocity, heading, valid


def made_corpus(folder: Path) -> Corpus:
    """Traffic with as many neighbours and lane pieces as the network looks at."""
    with CorpusWriter(folder, source="synthetic", configuration={}) as writer:
        for number, split in enumerate(SPLIT):
            scene = motorway(agents=96, frames=200, length_m=400.0, lanes=4, seed=number, pieces=40)
            writer.add(replace(scene, scene_id=f"bench-{number}", unit_id=f"bench-{number}"), split=split)
        return writer.finish()


def seconds(job: Callable[[], object], repeats: int) -> tuple[list[float], list[float]]:
    """Wall and CPU times of a job, after one that is not counted."""
    job()
    wall, cpu = [], []
    for _ in range(repeats):
        begin, begin_cpu = time.perf_counter(), time.process_time()
        job()
        wall.append(time.perf_counter() - begin)
        cpu.append(time.process_time() - begin_cpu)
    return wall, cpu


def show(name: str, values: Sequence[float], *, digits: int = 2) -> None:
    """One line: median, least, most, n and the target."""
    spread = f"{min(values):8.{digits}f} ..{max(values):8.{digits}f}"
    target = TARGETS.get(name, "")
    print(f"{name:32}{statistics.median(values):10.{digits}f}{spread:>22}{len(values):4}  {target}", flush=True)


class Clock:
    """Adds up the time inside the functions that it wraps."""

    def __init__(self) -> None:
        self.inside_s = 0.0

    def around(self, job: Callable[..., Any]) -> Callable[..., Any]:
        """The same function, timed."""

        def timed(*args: Any, **more: Any) -> Any:
            begin = time.perf_counter()
            result = job(*args, **more)
            self.inside_s += time.perf_counter() - begin
            return result

        return timed


def training(data: TrainingData, network: ForecastNetwork, *, repeats: int) -> None:
    """STEPS steps of the loop at a time, with a clock around all that is not the loop's own."""
    run = Loop(network, data, TrainSettings(batch_size=BATCH), runtime=runtime("cpu"), folder=Path())
    index, clock, collate = run._batches(0)[0], Clock(), data.example
    run.forward, run.runtime.backward = clock.around(run.forward), clock.around(run.runtime.backward)  # type: ignore[method-assign]
    run.optimizer.step, run.optimizer.zero_grad = map(clock.around, (run.optimizer.step, run.optimizer.zero_grad))
    object.__setattr__(data, "example", clock.around(collate))
    names = ("samples/s", "CPU ms per step of 32", "loop, ms per step", "collate, samples/s per core")
    rows: dict[str, list[float]] = {name: [] for name in names}
    with (
        patch("stylesim.forecasting.loop.mixture_loss", clock.around(mixture_loss)),
        patch("stylesim.forecasting.loop.responsible_query", clock.around(responsible_query)),
        patch.object(torch.nn.utils, "clip_grad_norm_", clock.around(torch.nn.utils.clip_grad_norm_)),
    ):
        for repeat in range(repeats + 1):
            run.step, run.total_steps, clock.inside_s = 0, STEPS, 0.0
            cpu = time.process_time()
            whole = _timed(lambda: run._train_epoch(None))
            cpu, work = time.process_time() - cpu, clock.inside_s
            gathered = time.process_time()
            collate(index, run.runtime.device)
            gathered = time.process_time() - gathered
            if repeat:  # the first one warms up
                values = (BATCH * STEPS / whole, cpu / STEPS * 1e3, (whole - work) / STEPS * 1e3, BATCH / gathered)
                for name, value in zip(names, values, strict=True):
                    rows[name].append(value)
    for name, measured in rows.items():
        show(name, measured)


def _timed(job: Callable[[], object]) -> float:
    begin = time.perf_counter()
    job()
    return time.perf_counter() - begin


def task_in(corpus: Corpus) -> ForecastTask:
    """The first window with at least DRIVERS drivers, or the fullest one; DRIVERS of them at most are asked."""
    best: ForecastTask | None = None
    for window in windows(corpus, SPEC):
        if best is None or len(window.targets) > len(best.agent_index):
            steps = SPEC.steps(window.scene.tracks.dt_s)[1]
            best = ForecastTask(window.history, window.targets[:DRIVERS], steps, window.t0)
        if len(best.agent_index) == DRIVERS:
            return best
    if best is None:
        raise SystemExit(f"{corpus.path} has no window with a driver to forecast")
    return best


def _bytes(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def measure(corpus: Corpus, cache: Path, *, repeats: int) -> None:
    """All rows of the table."""
    inputs = InputConfig.of(SPEC, corpus.info[0].dt_s)
    begin = time.perf_counter()
    store = compiled(corpus, SPEC, inputs, cache)
    took = time.perf_counter() - begin
    torch.manual_seed(0)
    network = ForecastNetwork(model_config("tiny", inputs))
    data = TrainingData(store, np.full((len(store), 3), -1, np.int64), inputs)
    network.intention_mps2.copy_(torch.from_numpy(data.intentions(network.config.queries, seed=0)))
    print(f"{len(store)} samples, {inputs.agents} agents, {inputs.polylines} polylines x {inputs.points} points")
    print(f"{'tiny, ' + str(torch.get_num_threads()) + ' threads':32}{'median':>10}{'min .. max':>22}{'n':>4}  target")
    show("compile, samples/s", [len(store) / took], digits=0)
    kept, steps = _bytes(cache), sum(info.n_steps for info in corpus.info)
    show("store / corpus on disk", [kept / _bytes(corpus.path)])
    show("store / tracks as float32", [kept / (FRAME_BYTES * steps)])
    training(data, network, repeats=repeats)
    model, task = TrainedForecaster("tiny", network, None), task_in(corpus)
    name = "predict, ms" if len(task.agent_index) == DRIVERS else f"predict {len(task.agent_index)} agents, ms"
    wall, cpu = seconds(lambda: model.predict([task]), 2 * repeats)
    show(name, [1e3 * t for t in wall])
    show("predict, CPU ms", [1e3 * t for t in cpu])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", nargs="?", type=Path, help="a merged corpus (with splits) at 0.1 s")
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--threads", type=int, default=2)
    asked = parser.parse_args()
    torch.set_num_threads(asked.threads)
    before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        corpus = Corpus(asked.corpus) if asked.corpus else made_corpus(Path(folder) / "corpus")
        measure(corpus, Path(folder) / "cache", repeats=asked.repeats)
    print(f"load average before {before:.1f}, after {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()
