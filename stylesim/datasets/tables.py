"""CSV files into checked tables, with errors that name the file."""

from __future__ import annotations

import gzip
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.errors import InputError

# 2023-09-24 12:00:00.016482+00:00; the fraction is left out where it is zero.
TIMESTAMP_FORMAT = "%Y-%m-%d %H:%M:%S%.f%:z"


def file_bytes(path: Path) -> bytes:
    """The content of a file, unpacked where its name ends in .gz; InputError where it is missing or damaged."""
    try:
        if path.suffix == ".gz":
            with gzip.open(path, "rb") as packed:
                return packed.read()
        return path.read_bytes()
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise InputError(f"{path} is a damaged or truncated gzip file ({error}); get it again") from error
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from error


@contextmanager
def refusing_malformed(path: Path) -> Iterator[None]:
    """A block that parses a CSV file with polars: what polars only warns of (rows that do not add up) is refused."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield
    said = [str(one.message) for one in found if "malformed" in str(one.message)]
    if said:
        raise InputError(f"{path} is no readable CSV table ({said[0][:200]}); is a quote missing?")


def csv_table(path: Path, columns: Mapping[str, Any], *, separator: str = ",") -> pl.DataFrame:
    """The named columns of a CSV file with a header, in those polars types; what cannot be parsed is null.

    InputError where the file is no text, empty, or lacks a column.
    """
    raw = file_bytes(path)
    header = raw.split(b"\n", 1)[0].decode("utf-8-sig", errors="replace").strip().split(separator)
    absent = [name for name in columns if name not in header]
    if absent:
        found = ", ".join(header)[:300]
        raise InputError(f"{path} lacks the columns {', '.join(absent)}; its first line has: {found or 'nothing'}")
    options: dict[str, Any] = {
        "schema_overrides": dict(columns), "ignore_errors": True, "columns": list(columns), "separator": separator,
    }  # fmt: skip
    try:
        with refusing_malformed(path):
            return pl.read_csv(raw, **options)
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{path} is no readable CSV table: {str(error).splitlines()[0]}") from error


def microseconds(column: str) -> pl.Expr:
    """UTC microseconds since 1970 of a text column of timestamps; null where a text is none."""
    return pl.col(column).str.to_datetime(TIMESTAMP_FORMAT, strict=False, time_unit="us").dt.epoch("us")
