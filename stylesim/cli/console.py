"""What the verbs share: messages, tables and progress bars."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

FILE_WIDTH = 160  # columns where the output is no terminal; chosen: the widest table, errors by style, fits

_out = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else FILE_WIDTH)
_err = Console(stderr=True, highlight=False, soft_wrap=True)


def say(text: str) -> None:
    """One line on stdout."""
    _out.print(escape(text))


def err(text: str) -> None:
    """One message on stderr."""
    _err.print(escape(text), style="red" if sys.stderr.isatty() else None)


def show_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A table on stdout; numbers to the right."""
    table = Table(title=escape(title), title_justify="left", header_style="bold")
    made = [[str(value) for value in row] for row in rows]
    for i, column in enumerate(columns):
        numeric = bool(made) and all(row[i].replace(".", "").replace("-", "").isdigit() or not row[i] for row in made)
        table.add_column(column, justify="right" if numeric else "left", no_wrap=i == 0, overflow="fold")
    for row in made:
        table.add_row(*(escape(value) for value in row))
    _out.print(table)


class Bar:
    """One progress bar; calling it is the `progress(done, total)` callback of the library."""

    def __init__(self, progress: Progress, title: str, unit: str) -> None:
        self._progress = progress
        self._title, self._unit = title, unit
        self._task: TaskID | None = None

    def __call__(self, done: int, total: int) -> None:
        """So many are done; a `total` of 0 means that it is not known."""
        if self._task is None:
            self._progress.start()  # only now: an error before the first step should stand alone on stderr
            self._task = self._progress.add_task(self._title, total=None, unit=self._unit)
        self._progress.update(self._task, completed=done, total=total or None)

    def stage(self, title: str, unit: str = "") -> None:
        """What is counted from here on gets a bar of its own."""
        self._title, self._unit, self._task = title, unit, None

    def told(self, stage: str, done: int, total: int) -> None:
        """The library's `progress(stage, done, total)`: a bar for each stage."""
        if stage != self._title:
            self.stage(stage, self._unit)
        self(done, total)


@contextmanager
def progress_bar(title: str, unit: str = "") -> Iterator[Bar]:
    """A bar on stderr from the first step on."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[unit]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    progress = Progress(*columns, console=_err)
    try:
        yield Bar(progress, title, unit)
    finally:
        if progress.tasks:
            progress.stop()
