"""The worker process: runs episodes and writes each as a part of the corpus. `python -m stylesim.simulation.workers`.

It speaks one JSON object per line: a job first, then tasks, and answers each. What libraries print goes to stderr.
When the parent's pipe closes it ends at once, also in the middle of an episode: nothing is left running.
"""

from __future__ import annotations

import errno
import json
import os
import queue
import signal
import sys
import threading
import traceback
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

from stylesim.corpus import write_part
from stylesim.corpus.files import storage_error
from stylesim.planners.loading import load_planner
from stylesim.population import Population
from stylesim.scenario import Scenario
from stylesim.scene import Scene
from stylesim.simulation.backend import Backend, open_backend
from stylesim.simulation.plan import PLAIN, EpisodePlan, TwinRequest
from stylesim.simulation.twins import twins_of


@runtime_checkable
class Prepares(Protocol):
    """A backend that can say before any work whether it can run a scenario."""

    def prepare(self, scenario: Scenario) -> None:
        """InputError if it cannot."""
        ...


class Task(NamedTuple):
    """One episode: its part of the corpus, the scenario's place in the job, the episode's number."""

    part: int
    scenario: int
    episode: int


@dataclass(frozen=True)
class Job:
    """What all tasks of one run have in common."""

    scenarios: tuple[Scenario, ...]
    population: Population
    seed: int
    partial: Path  # the corpus under construction
    plan: EpisodePlan = PLAIN  # of every episode
    twins: TwinRequest | None = None

    def to_dict(self) -> dict[str, Any]:
        """The JSON form."""
        return {
            "scenarios": [scenario.model_dump(mode="json") for scenario in self.scenarios],
            "population": asdict(self.population),
            "seed": self.seed,
            "partial": str(self.partial),
            "plan": self.plan.model_dump(mode="json"),
            "twins": None if self.twins is None else self.twins.model_dump(mode="json"),
        }

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> Job:
        """The job that `to_dict` wrote."""
        population = {**raw["population"], "shares": tuple(raw["population"]["shares"])}
        return cls(
            tuple(Scenario.model_validate(item) for item in raw["scenarios"]),
            Population(**population),
            raw["seed"],
            Path(raw["partial"]),
            EpisodePlan.model_validate(raw["plan"]),
            None if raw["twins"] is None else TwinRequest.model_validate(raw["twins"]),
        )


def with_driver_counts(scene: Scene) -> Scene:
    """The scene with the realised number of drivers of each style added to its counts as `drivers.<style>`."""
    styles = Counter(driver.name for driver in scene.tracks.driver if driver is not None)
    return replace(scene, counts={**scene.counts, **{f"drivers.{name}": n for name, n in sorted(styles.items())}})


def with_count(scene: Scene, name: str, n: int) -> Scene:
    """The scene with one count more."""
    return replace(scene, counts={**scene.counts, name: n})


class EpisodeRunner:
    """Keeps one open backend of each kind and runs tasks with them."""

    def __init__(self, job: Job) -> None:
        self._job = job
        if job.plan.ego:
            load_planner(job.plan.ego)  # here, so that a wrong one is said before the first episode
        self._backends: dict[str, Backend] = {
            name: open_backend(name) for name in sorted({scenario.backend for scenario in job.scenarios})
        }
        for scenario in job.scenarios:
            backend = self._backends[scenario.backend]
            if isinstance(backend, Prepares):
                backend.prepare(scenario)

    def run(self, task: Task) -> None:
        """Run one episode and its twins and write them as one part.

        StylesimError, with the part absent, if that is not possible.
        """
        write_part(self._job.partial, task.part, self.scenes(task))

    def scenes(self, task: Task) -> list[Scene]:
        """The episode, then its twins; who drives is counted in the first only, because it is the same people."""
        job, scenario = self._job, self._job.scenarios[task.scenario]
        backend = self._backends[scenario.backend]
        key = {"seed": job.seed, "episode": task.episode}
        scene = backend.run_episode(scenario, job.population, **key, plan=job.plan)
        made = [with_driver_counts(scene)]
        if job.twins is not None:
            twins = twins_of(scene, job.twins, job.population, backend=scenario.backend, **key)
            made[0] = with_count(made[0], "twins" if twins else "episodes_without_a_twin", max(1, len(twins)))
            for twin in twins:
                plan = job.plan.model_copy(update={"twin": twin})
                made.append(backend.run_episode(scenario, job.population, **key, plan=plan))
        return made

    def close(self) -> None:
        """End every simulation."""
        for backend in self._backends.values():
            backend.close()


def failure(error: Exception, partial: Path) -> dict[str, str]:
    """An error as a message: its class, its text, and where it happened."""
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        error = storage_error(error, Path(error.filename or partial))
    trace = "".join(traceback.format_exception(error))
    return {"error": type(error).__name__, "text": str(error), "trace": trace}


def _listen(requests: queue.SimpleQueue[dict[str, Any]]) -> None:
    """Pass on what the parent says; end the process when the parent is gone."""
    for line in sys.stdin.buffer:
        message = json.loads(line)
        requests.put(message)
        if "stop" in message:
            return
    os._exit(1)


def main() -> None:
    """Answer the parent until it says stop."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides what to do
    with os.fdopen(os.dup(1), "wb") as replies:
        os.dup2(2, 1)
        requests: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        threading.Thread(target=_listen, args=(requests,), daemon=True).start()
        runner: EpisodeRunner | None = None
        partial = Path()
        while "stop" not in (message := requests.get()):
            try:
                if "job" in message:
                    job = Job.from_dict(message["job"])
                    partial, runner = job.partial, EpisodeRunner(job)
                elif runner is not None:
                    runner.run(Task(*message["task"]))
                answer = {"done": "yes"}
            except Exception as error:  # noqa: BLE001 - the border of the process: every error travels to the parent
                answer = failure(error, partial)
            replies.write(json.dumps(answer).encode() + b"\n")
            replies.flush()
        if runner is not None:
            runner.close()


if __name__ == "__main__":
    main()
