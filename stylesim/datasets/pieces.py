"""A data set of many files, in pieces that are read alone: by this process, or by several, into the same parts.

The list of files fixes the pieces, a piece fixes the numbers of its parts; who reads it and when changes no byte.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from itertools import islice
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

from stylesim.corpus import write_part
from stylesim.corpus.files import json_bytes, write_whole
from stylesim.corpus.writer import PART_STEPS
from stylesim.datasets.accounting import added
from stylesim.datasets.formats import dataset_format
from stylesim.errors import InputError, StylesimError
from stylesim.scene import Scene

PIECE_FILES = 32  # chosen: the scenes of a part (CorpusWriter), where a file is a scene; a worker asks rarely for work
PIECE_PARTS = 10_000  # numbers kept for the parts of a piece; chosen: at 32 scenes each, more than any file holds
_BETWEEN = "\0"  # no name of a file holds it
AHEAD = 4  # pieces per worker that are handed out before the oldest is done; chosen: none waits for a slow one


class WorkerError(StylesimError):
    """A process that read files died."""

    exit_code = 4


@dataclass(frozen=True)
class Piece:
    """Files that are read together, and everything a process needs to do it."""

    number: int
    packed: str  # names of its files, seen from the root, joined by NUL: a data set has millions, and this is small
    root: Path
    format: str
    options: Mapping[str, Any]
    partial: Path

    @property
    def marker(self) -> Path:
        """The file that says that the piece is whole."""
        return self.partial / "records" / "pieces" / f"{self.number:07d}.json"

    @property
    def names(self) -> list[str]:
        """Its files, as seen from the root of the data set."""
        return self.packed.split(_BETWEEN)

    @property
    def files(self) -> list[Path]:
        """Its files."""
        return [self.root / name for name in self.names]


@dataclass(frozen=True)
class Done:
    """What finished pieces gave."""

    scenes: int = 0
    steps: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)

    def __add__(self, other: Done) -> Done:
        """What both gave together."""
        return Done(self.scenes + other.scenes, self.steps + other.steps, added(dict(self.counts), other.counts))


def pieces(files: Iterable[Path], *, root: Path, single: bool, **about: Any) -> list[Piece]:
    """The files in their order, PIECE_FILES to a piece, or one where a file holds many scenes."""
    size = 1 if single else PIECE_FILES
    names = (os.path.relpath(file, root) for file in files)
    groups = iter(lambda: _BETWEEN.join(islice(names, size)), "")
    return [Piece(number=number, packed=group, root=root, **about) for number, group in enumerate(groups)]


def finished(piece: Piece) -> Done | None:
    """What the piece gave in an earlier run; None if it was not finished, InputError if it was of other files."""
    try:
        kept = json.loads(piece.marker.read_bytes())
    except FileNotFoundError:
        return None
    if kept["files"] != piece.names:
        raise InputError(f"{piece.partial} was begun when {piece.root} held other files; remove it and start anew")
    return Done(kept["scenes"], kept["steps"], kept["counts"])


def read_piece(piece: Piece, seen: Callable[[], None]) -> Done:
    """Read a piece and write its parts; `seen` is called after each scene. InputError names the file."""
    pending: list[Scene] = []
    part, scenes, steps, filled = piece.number * PIECE_PARTS, 0, 0, 0
    counts: dict[str, int] = {}
    for scene in _scenes(piece):
        if part == (piece.number + 1) * PIECE_PARTS:
            raise InputError(f"{piece.files[0]} holds more scenes than a file can have; split it")
        pending.append(scene)
        n = int(scene.tracks.valid.sum())
        scenes, steps, filled, counts = scenes + 1, steps + n, filled + n, added(counts, scene.counts)
        if len(pending) == PIECE_FILES or filled >= PART_STEPS:
            write_part(piece.partial, part, pending)
            pending, part, filled = [], part + 1, 0
        seen()
    if pending:
        write_part(piece.partial, part, pending)
    kept = {"scenes": scenes, "steps": steps, "counts": counts, "files": piece.names}
    write_whole(piece.marker, json_bytes(kept))
    return Done(scenes, steps, counts)


def _scenes(piece: Piece) -> Iterator[Scene]:
    read = dataset_format(piece.format).scenes()
    for file in piece.files:
        yield from read(file, **piece.options)


def in_processes(waiting: Iterable[Piece], *, workers: int) -> Generator[Done]:
    """Read the pieces in processes of their own, results in their order; the first error in that order is raised.

    On an error, or when the caller stops, the others give up at their next scene. WorkerError if one was killed.
    """
    context = multiprocessing.get_context("spawn")  # a fork would copy the locks of the threads of polars
    stop = context.Event()
    running: deque[tuple[Piece, Future[Done]]] = deque()
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(stop,))
    try:
        for piece in waiting:
            running.append((piece, pool.submit(_work, piece)))
            if len(running) > AHEAD * workers:
                yield _result(*running.popleft())
        while running:
            yield _result(*running.popleft())
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)


def _result(piece: Piece, future: Future[Done]) -> Done:
    try:
        return future.result()
    except BrokenProcessPool:
        raise WorkerError(
            f"a process died while {piece.files[0]} or a later file was read (killed, or out of memory); finished "
            "files are kept: go on with --resume, or fewer --workers. A script that calls `read` with workers needs "
            'the line `if __name__ == "__main__":`'
        ) from None


_stop: Event | None = None


def _begin(stop: Event) -> None:
    """In the worker: one thread for tables, Ctrl-C is the parent's business, and no life without a parent."""
    global _stop  # noqa: PLW0603 - a process pool has no other place for what its initialiser got
    _stop = stop
    os.environ["POLARS_MAX_THREADS"] = "1"
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work(piece: Piece) -> Done:
    def check() -> None:
        if _stop is not None and _stop.is_set():
            raise WorkerError("stopped")

    check()
    return read_piece(piece, check)
