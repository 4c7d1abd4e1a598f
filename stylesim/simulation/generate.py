"""`generate`: episodes of scenarios, driven by a population, as a corpus."""

from __future__ import annotations

import json
import platform
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.corpus.files import new_folder, storage_error
from stylesim.errors import InputError, SimulationError
from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.simulation.plan import PLAIN, EpisodePlan, TwinRequest
from stylesim.simulation.pool import Pool
from stylesim.simulation.request import SOURCE, configuration
from stylesim.simulation.twins import LEAST_AHEAD_S
from stylesim.simulation.workers import Job, Task

KEPT = "Finished episodes are kept; the same command with --resume goes on from there."


def generate(
    scenarios: str | Sequence[str],
    population: Population | str,
    *,
    episodes: int,
    seed: int,
    out: str | Path,
    workers: int = 1,
    resume: bool = False,
    plan: EpisodePlan = PLAIN,
    twins: TwinRequest | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Corpus:
    """Simulate `episodes` of every scenario into one new corpus at `out`.

    Part number = place of the scenario x episodes + episode, one scene each (and its twins, if `twins` asks for them:
    see `simulation.twins`; `twin_of` pairs them). `plan` holds for every episode. The same arguments give the same
    bytes, whatever `workers` and however often it was interrupted and resumed; `run.json` holds what differs.
    Realised drivers per style are in the counts as `drivers.<style>` (see `realised_styles`).

    With `resume` an unfinished run of the same request goes on, and a finished one is returned as it is.
    Raises InputError before any work for what cannot be run, SimulationError where an episode cannot be finished,
    CorpusError where the disk refuses; finished episodes are kept then, under `out.partial`.
    """
    job = _checked(scenarios, population, episodes=episodes, seed=seed, out=Path(out), workers=workers)
    job = replace(job, plan=plan, twins=twins)
    _check_twins(job)
    request: dict[str, Any] = {"source": SOURCE, "seed": seed, "configuration": configuration(job, episodes)}
    if Path(out).exists():
        return _finished(Path(out), request, resume=resume)
    started = time.monotonic()
    writer: CorpusWriter | None = None
    try:
        with Pool(job, workers=workers) as pool:
            writer = CorpusWriter(out, **request, resume=resume)
            before = writer.done_parts()
            _simulate(pool, job, episodes=episodes, kept=before, progress=progress)
        _sweep(writer.partial)
        run = {
            "seconds": round(time.monotonic() - started, 3),
            "workers": workers,
            "resumed_episodes": len(before),
            "workers_that_died": pool.restarts,
            "machine": platform.platform(),
            "python": platform.python_version(),
        }
        return writer.finish(run=run)
    except BaseException as error:
        kept = writer is not None and writer.leave()
        if isinstance(error, OSError):
            raise storage_error(error, Path(error.filename or out)) from error
        if kept and isinstance(error, SimulationError):
            error.args = (f"{error}\n{KEPT}",)
        raise


def realised_styles(corpus: Corpus) -> dict[str, dict[str, int]]:
    """Drivers of each style in each scenario of a generated corpus."""
    found: dict[str, Counter[str]] = {}
    for info in corpus.info:
        counts = found.setdefault(info.scenario, Counter())
        for name, n in info.counts.items():
            if name.startswith("drivers."):
                counts[name.removeprefix("drivers.")] += n
    return {scenario: dict(sorted(counts.items())) for scenario, counts in found.items()}


def _simulate(
    pool: Pool, job: Job, *, episodes: int, kept: set[int], progress: Callable[[int, int], None] | None
) -> None:
    tasks = [
        Task(number * episodes + episode, number, episode)
        for number in range(len(job.scenarios))
        for episode in range(episodes)
    ]
    done = len(kept)

    def report() -> None:
        if progress is not None:
            progress(done, len(tasks))

    def one_more(_: Task) -> None:
        nonlocal done
        done += 1
        report()

    report()
    pool.run([task for task in tasks if task.part not in kept], one_more)


def _checked(
    scenarios: str | Sequence[str],
    population: Population | str,
    *,
    episodes: int,
    seed: int,
    out: Path,
    workers: int,
) -> Job:
    """The job that is asked for; InputError for what is not possible."""
    names = [scenarios] if isinstance(scenarios, str) else list(scenarios)
    if not names:
        raise InputError("no scenario was named; see `stylesim list scenarios`")
    for what, value, least in (("episodes", episodes, 1), ("seed", seed, 0), ("workers", workers, 1)):
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise InputError(f"{what} must be a whole number of at least {least}, not {value!r}")
    loaded = tuple(load_scenario(name) for name in names)
    for name, n in Counter(scenario.name for scenario in loaded).items():
        if n > 1:
            raise InputError(f"scenario {name!r} was named {n} times; name it once and raise --episodes instead")
    crowd = Population.load(population) if isinstance(population, str) else population
    partial = out.absolute().with_name(out.name + ".partial") if out.name else new_folder(out)[1]
    return Job(loaded, crowd, seed, partial)


def _check_twins(job: Job) -> None:
    """InputError for a switch of style at a time that leaves too little of an episode."""
    if job.twins is None or job.twins.at_s is None:
        return
    for scenario in job.scenarios:
        latest = scenario.duration_s - LEAST_AHEAD_S
        if not job.twins.at_s < latest:
            raise InputError(
                f"twins at {job.twins.at_s:g} s: scenario {scenario.name!r} logs {scenario.duration_s:g} s, and "
                f"{LEAST_AHEAD_S:g} s must be left to see a difference; choose a time below {latest:g} s"
            )


def _finished(out: Path, request: dict[str, Any], *, resume: bool) -> Corpus:
    """The corpus at `out` if it is the answer to this very request; InputError otherwise."""
    if not resume:
        raise InputError(f"{out} is there already; choose another --out, or remove it first")
    corpus = Corpus(out)
    asked = json.loads(json.dumps(request))
    if any(corpus.manifest.get(key) != value for key, value in asked.items()):
        raise InputError(f"{out} is there already, made with other settings; choose another --out, or remove it")
    return corpus


def _sweep(partial: Path) -> None:
    """Remove what killed workers left under temporary names."""
    for path in partial.rglob(".*.tmp"):
        path.unlink()
