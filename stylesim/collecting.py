"""Parsers make millions of objects of which none is garbage: looking through them meanwhile only costs time."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def no_collection() -> Iterator[None]:
    """A block in which Python's cycle collector rests. Not around a `yield` of the caller, who may stay away long."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()
