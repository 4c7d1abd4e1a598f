"""What a damaged or hostile file makes a parser raise becomes one error that names the file."""

from __future__ import annotations

import binascii
import pickle
import sqlite3
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.errors import InputError, StylesimError

MAX_BYTES = 4 << 30  # chosen: larger than any single file of the formats; a bigger one is refused, not loaded


@contextmanager
def reading(file: Path, what: str) -> Iterator[None]:
    """A block that parses `file`, which should be `what` ("an Argoverse 2 map").

    InputError naming the file for everything that bad content can raise; errors of ours pass unchanged. Overflow and
    the like are silent here: every number is held against its bounds before it is kept (`dense`, `rows`).
    """
    import polars as pl

    try:
        with np.errstate(all="ignore"):
            yield
    except StylesimError:
        raise
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    except (
        ValueError,  # with it json.JSONDecodeError, UnicodeDecodeError, shapes that do not fit
        LookupError,
        TypeError,
        AttributeError,
        ArithmeticError,
        EOFError,
        MemoryError,
        RecursionError,
        struct.error,
        zlib.error,
        binascii.Error,
        sqlite3.Error,
        pickle.UnpicklingError,
        pl.exceptions.PolarsError,
        pl.exceptions.PanicException,
    ) as error:
        reason = (str(error).splitlines() or [""])[0][:300]
        raise InputError(f"{file} is damaged or no {what} ({type(error).__name__}: {reason}); get it again") from error


def bounded(file: Path, limit: int = MAX_BYTES) -> Path:
    """The file, if it is one and not too large; else InputError."""
    try:
        if not file.is_file():
            raise InputError(f"{file} does not exist or is no file")
        size = file.stat().st_size
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    if size > limit:
        raise InputError(f"{file} has {size} bytes, more than the {limit} that a file of its kind can have")
    return file


def mapping(value: Any, what: str) -> Mapping[str, Any]:
    """A value that must be a set of named values; ValueError where it is none."""
    if not isinstance(value, Mapping):
        raise ValueError(f"{what}: expected named values, found {type(value).__name__}")
    return value


def mappings(value: Any, what: str) -> list[Mapping[str, Any]]:
    """A value that must be a list of sets of named values; ValueError where it is none."""
    if not isinstance(value, list | tuple):
        raise ValueError(f"{what}: expected a list, found {type(value).__name__}")
    return [mapping(one, what) for one in value]
