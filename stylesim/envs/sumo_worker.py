"""The child of one SUMO environment: `python -m stylesim.envs.sumo_worker`, spoken to on its standard input.

It ends when that pipe closes, or when its parent is gone although somebody else (a process forked from the parent)
still holds the pipe's other end.
"""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
import time

from stylesim.envs.sumo_episode import SumoEpisode
from stylesim.envs.wire import (
    Kind,
    packed_json,
    packed_picture,
    packed_snapshots,
    receive,
    send,
    unpacked_commands,
    unpacked_episode,
)
from stylesim.errors import SimulationError, StylesimError
from stylesim.simulation.sumo.engine import Engine

WATCH_S = 1.0


class Server:
    """Answers one message at a time."""

    def __init__(self) -> None:
        self._engine: Engine | None = None
        self._episode: SumoEpisode | None = None

    def answer(self, kind: Kind, body: bytes) -> tuple[Kind, bytes]:
        """The reply to a message; errors meant for the user become an ERROR reply."""
        try:
            return self._answer(kind, body)
        except StylesimError as error:
            return Kind.ERROR, packed_json({"type": type(error).__name__, "message": str(error)})

    def _answer(self, kind: Kind, body: bytes) -> tuple[Kind, bytes]:
        if kind is Kind.RESET:
            self._episode = None
            self._engine = self._engine or Engine()  # here, so that a missing libsumo is answered and not died of
            scenario, population, seed, config, egos = unpacked_episode(body)
            self._episode = SumoEpisode(self._engine, scenario, population, seed=seed, config=config, egos=egos)
            return Kind.SNAPSHOT, packed_snapshots(self._episode.first)
        if self._episode is None:
            raise SimulationError("no episode is running; call reset()")
        if kind is Kind.STEP:
            return Kind.SNAPSHOT, packed_snapshots(self._episode.step(unpacked_commands(body)))
        return Kind.PICTURE, packed_picture(self._episode.picture())

    def close(self) -> None:
        """End the simulation, if there is one."""
        self._episode = None
        if self._engine is not None:
            self._engine.close()


def _watch_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(WATCH_S)
    os._exit(1)


def _private_streams() -> tuple[io.BufferedReader, io.BufferedWriter]:
    """The pipes to the parent. What SUMO writes to standard output goes to standard error instead."""
    source = os.fdopen(os.dup(0), "rb")
    sink = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return source, sink


def main() -> int:
    """Serve until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business; it closes our pipe
    threading.Thread(target=_watch_parent, args=(os.getppid(),), daemon=True).start()
    source, sink = _private_streams()
    server = Server()
    try:
        while True:
            send(sink, *server.answer(*receive(source)))
    except (EOFError, BrokenPipeError):
        server.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
