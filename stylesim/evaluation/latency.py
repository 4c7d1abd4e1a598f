"""What a forecast costs: CPU and wall time per scene. Never part of what must be the same bytes on every machine."""

from __future__ import annotations

import os
import platform
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stylesim.corpus import Corpus
from stylesim.evaluation.asking import checked_answers, questions, reveal
from stylesim.forecast import Forecaster, ForecastTask
from stylesim.windows import WindowSpec

SCENES = 60  # chosen: the 95 % quantile then rests on three scenes
WARM_UP = 5  # chosen: first calls load, compile and allocate
AGENTS = 32  # the scene; of more, the first 32 are asked


@dataclass(frozen=True)
class Latency:
    """Milliseconds for one scene (its drivers, 32 at most) asked alone. CPU time is of all threads of the process."""

    scenes: int
    drivers: float  # mean number per scene
    cpu_median_ms: float
    cpu_p95_ms: float
    wall_median_ms: float
    wall_p95_ms: float
    machine: str

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return dict(vars(self))


def machine_name() -> str:
    """The processor, how many cores this process may use, and the load of the last minute."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:  # noqa: PTH123
            name = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), name)
    except OSError:
        pass
    return f"{name}, {len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.1f}"


def latency(
    forecaster: Forecaster, corpora: Sequence[Corpus], *, spec: WindowSpec, beside: Sequence[Forecaster] = ()
) -> Latency | None:
    """Time `predict` on one task after another, taken evenly from the corpora; None where nothing can be asked."""
    tasks = _tasks(forecaster, corpora, spec, (forecaster, *beside))
    if not tasks:
        return None
    for task in tasks[:WARM_UP]:
        checked_answers(forecaster, [task])
    cpu, wall = [], []
    for task in tasks:
        begun, clock = time.process_time(), time.perf_counter()
        checked_answers(forecaster, [task])
        cpu.append(1000 * (time.process_time() - begun))
        wall.append(1000 * (time.perf_counter() - clock))
    drivers = float(np.mean([len(task.agent_index) for task in tasks]))
    (cpu50, cpu95), (wall50, wall95) = (np.percentile(values, [50, 95]).tolist() for values in (cpu, wall))
    return Latency(len(tasks), drivers, cpu50, cpu95, wall50, wall95, machine_name())


def _tasks(
    forecaster: Forecaster, corpora: Sequence[Corpus], spec: WindowSpec, answering: Sequence[Forecaster]
) -> list[ForecastTask]:
    """At most SCENES tasks: the first scene of each corpus in turn, every few t0 of it."""
    share = -(-SCENES // max(len(corpora), 1))
    found: list[ForecastTask] = []
    for corpus in corpora:
        scene = next(iter(corpus), None)
        if scene is None:
            continue
        reveal(forecaster, scene)
        own = [one.task for one in questions(scene, spec, Counter(), answering)]
        for task in own[:: max(1, len(own) // share)][:share]:
            found.append(replace(task, agent_index=task.agent_index[:AGENTS]))
    return found[:SCENES]
