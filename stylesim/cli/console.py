"""What the verbs share: messages, tables and progress bars."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

FILE_WIDTH = 140  # columns where the output is no terminal; chosen: the widest table, errors by style, fits

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


@contextmanager
def progress_bar(title: str, unit: str = "") -> Iterator[Callable[[int, int], None]]:
    """A bar on stderr for the `progress(done, total)` callbacks of the library."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=_err) as bar:
        task = bar.add_task(title, total=None)

        def update(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total or None)  # 0: the total is not known

        yield update
