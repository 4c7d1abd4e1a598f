"""SQLite files of strangers: opened read-only and untouched, never trusting what is stored in their schema."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from urllib.parse import quote

from stylesim.datasets.guarding import bounded
from stylesim.errors import InputError

MAGIC = b"SQLite format 3\x00"
MAX_QUERY_S = 600.0  # chosen: the largest query takes seconds; a damaged index can make one run for ever


@contextmanager
def opened(file: Path, tables: Iterable[str]) -> Iterator[sqlite3.Connection]:
    """The database, read-only, without journal or locks. InputError where it lacks one of the tables.

    Every table must be a plain one: a view or virtual table could run what its author wrote.
    """
    bounded(file, 1 << 40)
    uri = f"file:{quote(str(file.resolve()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(uri, uri=True)) as connection:
        until = time.monotonic() + MAX_QUERY_S
        connection.set_progress_handler(lambda: int(time.monotonic() > until), 100_000)
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA cell_size_check = ON")
        rows = connection.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'").fetchall()
        plain = {name for name, sql in rows if isinstance(sql, str) and not sql.upper().startswith("CREATE VIRTUAL")}
        absent = [name for name in tables if name not in plain]
        if absent:
            raise InputError(f"{file} lacks the tables {', '.join(absent)}; it is another kind of database")
        yield connection


def has_tables(file: Path, tables: Iterable[str]) -> bool:
    """True if it is a SQLite file with these tables; never raises."""
    try:
        with file.open("rb") as opened_file:
            if opened_file.read(len(MAGIC)) != MAGIC:
                return False
        with opened(file, tables):
            return True
    except (InputError, OSError, sqlite3.Error, ValueError):
        return False
