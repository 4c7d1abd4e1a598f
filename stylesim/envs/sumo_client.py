"""`SumoWorld`: a SUMO simulation in a child process of its own, spoken to through pipes.

libsumo holds one simulation per process, so each environment has a child. It is a plain `subprocess`: the workers of
Gymnasium's AsyncVectorEnv are daemonic and may have no multiprocessing children. It ends when its pipe closes.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Sequence
from typing import IO

from stylesim.envs.config import EnvConfig
from stylesim.envs.wire import (
    Kind,
    packed_commands,
    packed_episode,
    receive,
    send,
    unpacked_picture,
    unpacked_snapshots,
)
from stylesim.envs.world import EgoCommand, Picture, Snapshot
from stylesim.errors import InputError, MissingDependencyError, SimulationError, StylesimError
from stylesim.population import Population
from stylesim.scenario import Scenario

ERRORS: dict[str, type[StylesimError]] = {
    "InputError": InputError,
    "SimulationError": SimulationError,
    "MissingDependencyError": MissingDependencyError,
}
GRACE_S = 2.0  # how long a child may take to end by itself


class SumoWorld:
    """The simulation behind the environments in SUMO, with `egos` of them."""

    def __init__(self, config: EnvConfig, *, egos: int = 1) -> None:
        self._config = config
        self._egos = egos
        self._child: subprocess.Popen[bytes] | None = None
        self._log: IO[bytes] | None = None
        self._finalizer: weakref.finalize[..., SumoWorld] | None = None

    @property
    def pid(self) -> int | None:
        """Process id of the child, None while there is none."""
        return None if self._child is None else self._child.pid

    def reset(self, *, scenario: Scenario, population: Population, seed: int) -> tuple[Snapshot, ...]:
        """A new episode; starts the child if there is none."""
        if self._child is None:
            self._start()
        body = self._ask(Kind.RESET, packed_episode(scenario, population, seed, self._config, self._egos))
        return unpacked_snapshots(body)

    def step(self, commands: Sequence[EgoCommand]) -> tuple[Snapshot, ...]:
        """One decision period; SimulationError if the child has died."""
        return unpacked_snapshots(self._ask(Kind.STEP, packed_commands(commands)))

    def picture(self) -> Picture:
        """The road of this episode."""
        return unpacked_picture(self._ask(Kind.PICTURE))

    def close(self) -> None:
        """End the child and wait for it."""
        if self._finalizer is not None:
            self._finalizer()
        self._child, self._log, self._finalizer = None, None, None

    def _start(self) -> None:
        log = tempfile.TemporaryFile()  # noqa: SIM115  # lives as long as the child; closed by the finalizer
        command = [sys.executable, "-m", "stylesim.envs.sumo_worker"]
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log)
        self._child, self._log = child, log
        self._finalizer = weakref.finalize(self, _end, child, log)

    def _ask(self, kind: Kind, body: bytes = b"") -> bytes:
        child = self._child
        if child is None or child.stdin is None or child.stdout is None:
            raise SimulationError("the simulation of this environment is not running; call reset()")
        try:
            send(child.stdin, kind, body)
            answer, content = receive(child.stdout)
        except (EOFError, OSError, KeyboardInterrupt) as error:
            words = self._last_words()
            self.close()  # after an interrupt the pipes are out of step, so this child is of no more use
            if isinstance(error, KeyboardInterrupt):
                raise
            raise SimulationError(
                f"the process that simulates this environment has died; reset() starts a new one.{words}"
            ) from error
        if answer is Kind.ERROR:
            raw = json.loads(content)
            raise ERRORS.get(raw["type"], SimulationError)(raw["message"])
        return content

    def _last_words(self) -> str:
        if self._log is None:
            return ""
        self._log.seek(0)
        lines = self._log.read().decode(errors="replace").strip().splitlines()
        return " It said last: " + " / ".join(lines[-3:]) if lines else ""


def _end(child: subprocess.Popen[bytes], log: IO[bytes]) -> None:
    """Close the pipes, wait, kill if need be: nothing is left behind."""
    for pipe in (child.stdin, child.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):  # the child may be gone with our last bytes unread
                pipe.close()
    try:
        child.wait(GRACE_S)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
    log.close()
