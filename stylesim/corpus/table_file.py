"""`TableFile`: a table of any length, written in bounded memory, there under its name only when whole."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import polars as pl

from stylesim.corpus.files import sha256_of, storage_error, write_whole
from stylesim.corpus.tables import LEVEL, ROW_GROUP, parquet_bytes

# Rows that wait in memory, and of one part file. Chosen: some tens of MB; the bytes do not depend on it.
PART_ROWS = 1 << 16


class TableFile:
    """Takes tables with the same columns one by one. Call `finish`, and `discard` in any case.

    Up to `part_rows` rows (PART_ROWS, where not given) are held; more go to part files in a hidden folder beside the
    file and are joined at the end, one row group at a time. The same rows give the same bytes, however they were
    cut into tables.
    """

    def __init__(self, path: Path, *, row_group: int = ROW_GROUP, part_rows: int | None = None) -> None:
        self.path = path
        self._row_group = row_group
        self._part_rows = PART_ROWS if part_rows is None else part_rows
        self._parts = path.with_name(f".{path.name}.{os.getpid()}.parts")
        self._count = 0
        self._waiting: list[pl.DataFrame] = []
        self._rows = 0

    def add(self, table: pl.DataFrame) -> None:
        """Append a table. CorpusError if the disk is full or the folder cannot be written."""
        self._waiting.append(table)
        self._rows += table.height
        if self._rows >= self._part_rows:
            self._write_part()

    def finish(self) -> str:
        """Put the file in its place; returns its sha256. CorpusError as in `add`; an older file stays then."""
        if not self._count:
            return write_whole(
                self.path, parquet_bytes(pl.concat(self._waiting, rechunk=True), row_group=self._row_group)
            )
        if self._rows:
            self._write_part()
        whole = self._parts / "whole.parquet"
        try:
            pl.scan_parquet([self._part(number) for number in range(self._count)]).sink_parquet(
                whole, compression="zstd", compression_level=LEVEL, row_group_size=self._row_group, statistics=False,
                maintain_order=True,
            )  # fmt: skip
            digest = sha256_of(whole)
            whole.replace(self.path)
        except OSError as error:
            raise storage_error(error, self.path) from error
        return digest

    def discard(self) -> None:
        """Remove what was written on the way."""
        self._waiting.clear()
        shutil.rmtree(self._parts, ignore_errors=True)

    def _part(self, number: int) -> Path:
        return self._parts / f"{number:06d}.parquet"

    def _write_part(self) -> None:
        try:
            self._parts.mkdir(parents=True, exist_ok=True)
            table = pl.concat(self._waiting)
            # Compressed lightly: it is read once and thrown away.
            table.write_parquet(self._part(self._count), compression="zstd", compression_level=1, statistics=False)
        except OSError as error:
            raise storage_error(error, self.path) from error
        self._count += 1
        self._waiting, self._rows = [], 0
