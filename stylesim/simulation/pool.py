"""Worker processes from the parent's side: started, fed, noticed when they die, stopped."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable
from typing import Any

from stylesim import errors
from stylesim.errors import SimulationError, StylesimError
from stylesim.simulation.workers import Job, Task

ATTEMPTS = 2  # chosen: a worker may die of something else than its episode (memory, a signal) once
PATIENCE_S = 5.0  # how long a worker may take to close its simulation
POLL_S = 0.5  # a wait without end could not be interrupted by Ctrl-C everywhere
ENVIRONMENT = {"POLARS_MAX_THREADS": "1", "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}


class WorkerDiedError(Exception):
    """The process ended without an answer."""


def raised(answer: dict[str, str], place: str) -> StylesimError:
    """The error that a worker sent, as one of ours; its traceback goes along as a note."""
    kind = getattr(errors, answer["error"], None)
    if isinstance(kind, type) and issubclass(kind, StylesimError) and kind is not SimulationError:
        error = kind(answer["text"])
    else:
        name = "" if kind is SimulationError else f"{answer['error']}: "
        error = SimulationError(f"{place}: {name}{answer['text']}")
    error.add_note(answer["trace"])
    return error


class Worker:
    """One worker process, its pipes, and what it said last on stderr."""

    def __init__(self) -> None:
        self._words = tempfile.TemporaryFile()  # noqa: SIM115 - closed in `kill`
        self.process = subprocess.Popen(
            [sys.executable, "-m", "stylesim.simulation.workers"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._words,
            env={**os.environ, **ENVIRONMENT},
        )

    def ask(self, message: dict[str, Any], place: str) -> None:
        """Send a message and wait for its answer; the worker's StylesimError, or WorkerDiedError."""
        assert self.process.stdin is not None and self.process.stdout is not None
        try:
            self.process.stdin.write(json.dumps(message).encode() + b"\n")
            self.process.stdin.flush()
            line = self.process.stdout.readline()
        except (OSError, ValueError):  # a broken pipe, or closed by `kill` from another thread
            line = b""
        if not line.endswith(b"\n"):
            raise WorkerDiedError(self._obituary())
        answer: dict[str, str] = json.loads(line)
        if "error" in answer:
            raise raised(answer, place)

    def _obituary(self) -> str:
        self.process.kill()
        code = self.process.wait()
        how = f"exit code {code}"
        if code < 0:
            how = f"killed by {signal.Signals(-code).name}" if -code in list(signal.Signals) else f"signal {-code}"
        try:
            self._words.seek(0)
            tail = self._words.read()[-2000:].decode(errors="replace").strip()
        except ValueError:  # closed by `kill`
            tail = ""
        return how + (f"; its last words:\n{tail}" if tail else "")

    def stop(self) -> None:
        """Let it close its simulation, then make sure that it is gone."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(b'{"stop": true}\n')
            self.process.stdin.flush()
            self.process.wait(PATIENCE_S)
        except (OSError, ValueError, subprocess.TimeoutExpired):
            pass  # it is killed below
        self.kill()

    def kill(self) -> None:
        """End it at once."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout, self._words):
            try:
                if pipe is not None:
                    pipe.close()
            except OSError:
                continue  # unsent bytes of a dead pipe


class Pool:
    """Runs tasks on worker processes, one thread of the parent for each; a context manager that leaves none behind."""

    def __init__(self, job: Job, *, workers: int) -> None:
        self._job = job
        self._size = workers
        self._idle: list[Worker] = []
        self._all: set[Worker] = set()
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._threads: list[threading.Thread] = []
        self.restarts = 0

    def __enter__(self) -> Pool:
        """Start the first worker, which opens every simulator that is needed; its error if that fails."""
        try:
            self._idle.append(self._start())
        except WorkerDiedError as death:
            self.close()
            raise SimulationError(f"the worker process died while it opened the simulators ({death})") from None
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start(self) -> Worker:
        with self._lock:
            if self._stopping.is_set():
                raise WorkerDiedError("stopped")
            worker = Worker()
            self._all.add(worker)
        worker.ask({"job": self._job.to_dict()}, "opening the simulators")
        return worker

    def run(self, tasks: Iterable[Task], done: Callable[[Task], None]) -> None:
        """Run every task; `done` is called here, in the order in which they end. Raises the first error."""
        waiting: queue.SimpleQueue[Task] = queue.SimpleQueue()
        left = 0
        for task in tasks:
            waiting.put(task)
            left += 1
        ended: queue.SimpleQueue[tuple[Task, Exception | None]] = queue.SimpleQueue()
        for _ in range(min(self._size, left)):
            thread = threading.Thread(target=self._serve, args=(waiting, ended), daemon=True)
            self._threads.append(thread)
            thread.start()
        while left:
            try:
                task, error = ended.get(timeout=POLL_S)
            except queue.Empty:
                continue
            if error is not None:
                raise error
            left -= 1
            done(task)

    def _serve(self, waiting: queue.SimpleQueue[Task], ended: queue.SimpleQueue[tuple[Task, Exception | None]]) -> None:
        worker: Worker | None = None
        while not self._stopping.is_set():
            try:
                task = waiting.get_nowait()
            except queue.Empty:
                break
            try:
                worker = self._run(task, worker)
            except Exception as error:  # noqa: BLE001 - the border of the thread: raised again in `run`
                ended.put((task, error))
                return
            ended.put((task, None))
        if worker is not None and not self._stopping.is_set():
            worker.stop()

    def _run(self, task: Task, worker: Worker | None) -> Worker:
        """Run the task in that worker, or in a fresh one; once more if the worker dies."""
        place = f"scenario {self._job.scenarios[task.scenario].name!r}, episode {task.episode}"
        deaths: list[str] = []
        while len(deaths) < ATTEMPTS:
            try:
                if worker is None:
                    worker = self._hand_over() or self._start()
                worker.ask({"task": list(task)}, place)
                return worker
            except WorkerDiedError as death:
                deaths.append(str(death))
                worker = None
                self.restarts += 1
                if self._stopping.is_set():
                    break
        raise SimulationError(f"{place}: the worker process died {len(deaths)} times ({deaths[-1]})")

    def _hand_over(self) -> Worker | None:
        with self._lock:
            return self._idle.pop() if self._idle else None

    def close(self) -> None:
        """Kill what still runs and wait for the threads."""
        with self._lock:
            self._stopping.set()
            workers = tuple(self._all)
        for worker in workers:
            worker.process.kill()
        for thread in self._threads:
            thread.join()
        for worker in workers:
            worker.kill()
