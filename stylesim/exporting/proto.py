"""Protocol buffers, the writing side: fields one after the other (protobuf.dev/programming-guides/encoding)."""

from __future__ import annotations

import struct
from collections.abc import Iterable


def varint(value: int) -> bytes:
    """A number of any size; negative ones as two's complement of 64 bits."""
    value &= 0xFFFFFFFFFFFFFFFF
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def integer(number: int, value: int) -> bytes:
    """An integer, boolean or enumeration field."""
    return varint(number << 3) + varint(value)


def text(number: int, value: str) -> bytes:
    """A string field."""
    return message(number, value.encode())


def message(number: int, content: bytes) -> bytes:
    """A field of bytes or of a message."""
    return varint(number << 3 | 2) + varint(len(content)) + content


def double(number: int, value: float) -> bytes:
    """A double field."""
    return varint(number << 3 | 1) + struct.pack("<d", value)


def single(number: int, value: float) -> bytes:
    """A float field."""
    return varint(number << 3 | 5) + struct.pack("<f", value)


def packed_doubles(number: int, values: Iterable[float]) -> bytes:
    """A repeated double field, packed."""
    found = list(values)
    return message(number, struct.pack(f"<{len(found)}d", *found))
