"""Cheap looks at files and folders that never raise: what a reader's `sniff` is made of."""

from __future__ import annotations

import gzip
import zlib
from itertools import islice
from pathlib import Path

HEAD_BYTES = 4096  # chosen: a header line or magic number lies within it
LOOKED_AT = 1000  # chosen: so many entries of a folder are looked at, of however many there are


def head(path: Path, n: int = HEAD_BYTES) -> bytes:
    """The first bytes of a file (unpacked where its name ends in .gz); empty where it cannot be read."""
    try:
        if not path.is_file():
            return b""
        if path.suffix == ".gz":
            with gzip.open(path, "rb") as packed:
                return packed.read(n)
        with path.open("rb") as file:
            return file.read(n)
    except (OSError, EOFError, zlib.error, ValueError):
        return b""


def header(path: Path, separator: str = ",") -> tuple[str, ...]:
    """The names in the first line of a table of text; empty where it cannot be read."""
    line = head(path, 1 << 16).split(b"\n", 1)[0].decode("utf-8-sig", errors="replace")
    return tuple(name.strip().strip('"') for name in line.split(separator)) if line.strip() else ()


def matching(path: Path, *patterns: str, at_most: int | None = LOOKED_AT) -> list[Path]:
    """The file itself if its name matches one of the patterns, else such files in the folder, sorted.

    A pattern may hold a folder ("*/x.json" looks one level down). Empty where nothing can be read. For a look at most
    so many files of each pattern are found; a reader, which must miss none, calls `listed`.
    """
    try:
        if path.is_file():
            names = [pattern.rsplit("/", 1)[-1] for pattern in patterns]
            return [path] if any(path.match(name) for name in names) else []
        found: set[Path] = set()
        for pattern in patterns:
            found.update(islice(path.glob(pattern), at_most))
        return sorted(found)
    except (OSError, ValueError):
        return []


def listed(path: Path, *patterns: str) -> list[Path]:
    """As `matching`, but every file, however many there are."""
    return matching(path, *patterns, at_most=None)
