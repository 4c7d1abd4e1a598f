"""The wire format of protocol buffers, as far as reading foreign messages needs it.

By protobuf.dev/programming-guides/encoding. Messages are read where they lie: a field of bytes is its (start, end)
in the record, so that arrays can be made of many equal messages at once (`fixed`).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Int64

from stylesim.datasets.wire_scan import BYTES, FIXED32, FIXED64, SCAN_ERRORS, VARINT, scanned

Span = tuple[int, int]
Fields = dict[int, list[Any]]  # field number -> ints (varint) or spans (everything else), in the order of the file


class WireError(ValueError):
    """These bytes are no protocol buffer."""


def varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    """The number at `at`, and where the next field begins."""
    value, shift = 0, 0
    while at < end and shift < 70:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
    raise WireError("a number is cut off")


def fields(data: bytes, span: Span) -> Fields:
    """The fields of the message in that span. WireError where it is none."""
    at, end = span
    found: Fields = {}
    while at < end:
        key, at = (data[at], at + 1) if data[at] < 0x80 else varint(data, at, end)
        wire = key & 7
        value: Any
        if wire == BYTES:
            length, at = varint(data, at, end)
            value = (at, at + length)
            at += length
        elif wire == VARINT:
            value, at = varint(data, at, end)
        elif wire == FIXED64:
            value = (at, at + 8)
            at += 8
        elif wire == FIXED32:
            value = (at, at + 4)
            at += 4
        else:
            raise WireError(f"a field of type {wire}")
        if at > end:
            raise WireError("a field is cut off")
        found.setdefault(key >> 3, []).append(value)
    return found


def split(data: bytes, span: Span, number: int) -> tuple[Fields, Int64[np.ndarray, "item 2"]]:
    """The fields of a message that repeats one field of bytes by the hundred: (all others, that one's spans).

    WireError as `fields`, and where field `number` is something else.
    """
    keys, first, second = scanned(np.frombuffer(data, np.uint8), span[0], span[1])
    if len(keys) and keys[-1] < 0:
        raise WireError(SCAN_ERRORS[keys[-1]])
    repeated = keys == number << 3 | BYTES
    rest: Fields = {}
    for key, begin, end in zip(*(part[~repeated].tolist() for part in (keys, first, second)), strict=True):
        rest.setdefault(key >> 3, []).append(begin if key & 7 == VARINT else (begin, end))
    if number in rest:
        raise WireError(f"field {number} is of another type")
    found = np.empty((int(repeated.sum()), 2), np.int64)
    found[:, 0], found[:, 1] = first[repeated], second[repeated]
    return rest, found


def spans(message: Fields, number: int) -> list[Span]:
    """The spans of a field of bytes, messages or fixed numbers; WireError where it is a number instead."""
    found = message.get(number, [])
    if any(isinstance(value, int) for value in found):
        raise WireError(f"field {number} is a number")
    return found


def integer(message: Fields, number: int, default: int = 0) -> int:
    """The last value of an integer field, negative ones as two's complement; `default` where it is missing."""
    found = message.get(number)
    if not found:
        return default
    if not isinstance(found[-1], int):
        raise WireError(f"field {number} is no number")
    value = found[-1]
    return value - (1 << 64) if value >= 1 << 63 else value


def real(data: bytes, message: Fields, number: int, default: float = float("nan")) -> float:
    """The last value of a float or double field; `default` where it is missing."""
    found = spans(message, number)
    if not found:
        return default
    start, end = found[-1]
    if end - start not in (4, 8):
        raise WireError(f"field {number} is no float")
    return float(struct.unpack("<d" if end - start == 8 else "<f", data[start:end])[0])


def text(data: bytes, message: Fields, number: int) -> str:
    """The last value of a string field; "" where it is missing."""
    found = spans(message, number)
    return data[found[-1][0] : found[-1][1]].decode("utf-8") if found else ""


def doubles(data: bytes, message: Fields, number: int) -> list[float]:
    """A repeated double field, packed or not."""
    joined = b"".join(data[start:end] for start, end in spans(message, number))
    if len(joined) % 8:
        raise WireError(f"field {number} is no list of doubles")
    return np.frombuffer(joined, "<f8").tolist()


def integers(data: bytes, message: Fields, number: int) -> Int64[np.ndarray, " value"]:
    """A repeated integer field, packed or not."""
    found = message.get(number, [])
    loose = [value for value in found if isinstance(value, int)]
    packed = [packed_varints(data[v[0] : v[1]]) for v in found if not isinstance(v, int)]
    single = np.array([value & 0xFFFFFFFFFFFFFFFF for value in loose], np.uint64).view(np.int64)
    return np.concatenate([single, *packed]) if packed else single


def packed_varints(packed: bytes) -> Int64[np.ndarray, " value"]:
    """The numbers of a packed field."""
    raw = np.frombuffer(packed, np.uint8)
    ends = np.flatnonzero(raw < 0x80)
    if len(raw) and (not len(ends) or ends[-1] != len(raw) - 1):
        raise WireError("a number is cut off")
    starts = np.concatenate([[0], ends[:-1] + 1]) if len(ends) else np.zeros(0, np.int64)
    width = ends - starts + 1
    if len(width) and width.max() > 10:
        raise WireError("a number is too long")
    values = np.zeros(len(ends), np.uint64)
    for k in range(int(width.max(initial=0))):
        there = k < width
        values[there] |= (raw[starts[there] + k].astype(np.uint64) & np.uint64(0x7F)) << np.uint64(7 * k)
    return values.view(np.int64)


def fixed(
    data: bytes, found: Sequence[Span] | Int64[np.ndarray, "item 2"], layout: np.dtype[Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Messages that all have one layout of bytes, at once: (rows of `layout`, True for each span that has its size).

    A writer that puts every field, in order, gives messages of equal size; the caller checks the tags in the rows.
    """
    where = np.array(found, np.int64).reshape(-1, 2)
    same = (where[:, 1] - where[:, 0]) == layout.itemsize
    raw = np.frombuffer(data, np.uint8)
    rows = raw[where[same, :1] + np.arange(layout.itemsize)]
    return np.ascontiguousarray(rows).view(layout).reshape(-1), same
