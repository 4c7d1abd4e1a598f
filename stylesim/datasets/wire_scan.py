"""The fields of one message of the wire format, found by compiled code: for fields that repeat by the hundred."""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5  # the wire types [read: protobuf.dev/programming-guides/encoding]
SCAN_ERRORS = {-1: "a number is cut off", -2: "a field of an unknown type", -3: "a field is cut off"}


@njit(cache=True, nogil=True)
@no_type_check
def scanned(data, at, end):
    """Key, value or begin, and end of each field; the last key is one of SCAN_ERRORS where the bytes are none."""
    most = (end - at) // 2 + 1  # a field has two bytes at least
    keys, first, second = np.empty(most, np.int64), np.empty(most, np.uint64), np.zeros(most, np.int64)
    n = 0
    while at < end:
        key, at = _number(data, at, end)
        if at < 0 or key >= np.uint64(1) << np.uint64(62):
            keys[n] = -1
            return keys[: n + 1], first[: n + 1], second[: n + 1]
        kind = key & np.uint64(7)
        keys[n], size = np.int64(key), 0
        if kind == BYTES:
            length, at = _number(data, at, end)
            size = end + 1 if length > np.uint64(end) else np.int64(length)
        elif kind == VARINT:
            first[n], at = _number(data, at, end)
        elif kind in (FIXED64, FIXED32):
            size = 8 if kind == FIXED64 else 4
        else:
            keys[n] = -2
            return keys[: n + 1], first[: n + 1], second[: n + 1]
        if at < 0 or at + size > end:
            keys[n] = -1 if at < 0 else -3
            return keys[: n + 1], first[: n + 1], second[: n + 1]
        if kind != VARINT:
            first[n], second[n] = np.uint64(at), at + size
        at += size
        n += 1
    return keys[:n], first[:n], second[:n]


@njit(cache=True, nogil=True)
@no_type_check
def _number(data, at, end):
    """As `varint`, in 64 bits; the place is -1 where the number is cut off."""
    value, shift = np.uint64(0), np.uint64(0)
    while at < end and shift < 70:
        byte = np.uint64(data[at])
        at += 1
        if shift < 64:
            value |= (byte & np.uint64(0x7F)) << shift
        if byte < 0x80:
            return value, at
        shift += np.uint64(7)
    return value, -1
