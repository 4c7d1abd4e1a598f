"""Zarr version 2 arrays of records, as far as the Lyft data set uses them: one dimension, blosc or no compression."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.datasets.guarding import bounded
from stylesim.errors import InputError, MissingDependencyError

MAX_CHUNK_BYTES = 1 << 30  # chosen: the data set's chunks unpack to 1 to 20 MB
MAX_ROWS = 1 << 40
_BLOSC_HEADER = struct.Struct("<BBBBIII")  # version, codec version, flags, type size, bytes, block, packed bytes


class RecordArray:
    """One array: `rows(start, stop)` unpacks the chunks that it needs, and keeps the last one."""

    def __init__(self, folder: Path, dtype: np.dtype[Any]) -> None:
        """InputError, or what bad JSON raises, where the array is missing or holds other fields than `dtype`."""
        self.folder, self.dtype = folder, dtype
        meta = json.loads(bounded(folder / ".zarray", 1 << 20).read_bytes())
        if meta["zarr_format"] != 2 or meta.get("filters") or meta.get("order", "C") != "C":
            raise InputError(f"{folder} is no plain zarr array of version 2")
        if _dtype(meta["dtype"]) != dtype:
            raise InputError(f"{folder} holds records of {meta['dtype']}; expected {dtype.descr}")
        (self.length,), (self.chunk,) = meta["shape"], meta["chunks"]
        if not (isinstance(self.length, int) and 0 <= self.length <= MAX_ROWS):
            raise InputError(f"{folder} claims {self.length} rows")
        if not (isinstance(self.chunk, int) and 0 < self.chunk * dtype.itemsize <= MAX_CHUNK_BYTES):
            raise InputError(f"{folder} claims chunks of {self.chunk} rows")
        self.packed = meta["compressor"] is not None
        if self.packed and meta["compressor"].get("id") != "blosc":
            raise InputError(f"{folder} is compressed by {meta['compressor'].get('id')}; only blosc is read")
        self._last: tuple[int, np.ndarray] | None = None

    def rows(self, start: int, stop: int) -> np.ndarray:
        """The rows [start, stop). InputError where a chunk is missing, or not of its size."""
        if not 0 <= start <= stop <= self.length:
            raise InputError(f"{self.folder} has {self.length} rows; {start} to {stop} are asked for")
        parts = [np.zeros(0, self.dtype)]
        for number in range(start // self.chunk, -(-stop // self.chunk)):
            first = number * self.chunk
            parts.append(self._chunk(number)[max(start - first, 0) : stop - first])
        return np.concatenate(parts)

    def _chunk(self, number: int) -> np.ndarray:
        if self._last is None or self._last[0] != number:
            file = bounded(self.folder / str(number), MAX_CHUNK_BYTES)
            raw = file.read_bytes()
            expected = self.chunk * self.dtype.itemsize
            plain = _unpacked(raw, expected, file) if self.packed else raw
            if len(plain) != expected:
                raise InputError(f"{file} unpacks to {len(plain)} bytes instead of {expected}; it is damaged")
            self._last = number, np.frombuffer(plain, self.dtype)
        return self._last[1]


def _dtype(fields: Sequence[Any]) -> np.dtype[Any]:
    return np.dtype([(f[0], f[1], tuple(f[2])) if len(f) == 3 else (f[0], f[1]) for f in fields])


def _unpacked(raw: bytes, expected: int, file: Path) -> bytes:
    """The content of a blosc chunk; its header is held against what is expected before anything is reserved."""
    try:
        from numcodecs.blosc import decompress
    except ImportError as error:
        raise MissingDependencyError("reading zarr needs numcodecs: pip install 'stylesim[lyft]'") from error
    if len(raw) < _BLOSC_HEADER.size:
        raise InputError(f"{file} is truncated")
    _, _, _, _, size, _, packed = _BLOSC_HEADER.unpack(raw[: _BLOSC_HEADER.size])
    if size != expected or packed != len(raw):
        raise InputError(f"{file} claims {size} bytes in {packed}; it has {len(raw)} for {expected}: it is damaged")
    try:
        return bytes(decompress(raw))
    except RuntimeError as error:
        raise InputError(f"{file} is damaged: {error}") from error
