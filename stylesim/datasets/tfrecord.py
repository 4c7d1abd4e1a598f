"""TFRecord files: length and content of each record guarded by a masked CRC-32C.

The framing is that of TensorFlow's documentation: uint64 length, uint32 masked CRC of the length, the bytes,
uint32 masked CRC of the bytes, all little endian; masked = rotate right by 15 bits, plus 0xa282ead8.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import no_type_check

import numpy as np
from jaxtyping import UInt32
from numba import njit

from stylesim.errors import InputError

_POLYNOMIAL = 0x82F63B78  # Castagnoli, reflected
_MASK_DELTA = 0xA282EAD8
HEADER_BYTES = 12
MAX_RECORD_BYTES = 1 << 30  # chosen: scenarios have 1 to 5 MB without lidar, some 100 MB with it


def _tables() -> UInt32[np.ndarray, "8 256"]:
    """Tables for eight bytes at a time (slicing by 8)."""
    tables = np.zeros((8, 256), np.uint32)
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = (value >> 1) ^ (_POLYNOMIAL if value & 1 else 0)
        tables[0, byte] = value
    for k in range(1, 8):
        tables[k] = (tables[k - 1] >> 8) ^ tables[0][tables[k - 1] & 0xFF]
    return tables


_TABLES = _tables()


@njit(cache=True, nogil=True)
@no_type_check
def _crc32c(data, t):
    """CRC-32C of an array of bytes, with the tables t [8 256]."""
    crc = np.uint32(0xFFFFFFFF)
    n, i = len(data), 0
    while i + 8 <= n:
        low = crc ^ (
            np.uint32(data[i])
            | (np.uint32(data[i + 1]) << np.uint32(8))
            | (np.uint32(data[i + 2]) << np.uint32(16))
            | (np.uint32(data[i + 3]) << np.uint32(24))
        )
        crc = (
            t[7, low & np.uint32(0xFF)]
            ^ t[6, (low >> np.uint32(8)) & np.uint32(0xFF)]
            ^ t[5, (low >> np.uint32(16)) & np.uint32(0xFF)]
            ^ t[4, low >> np.uint32(24)]
            ^ t[3, data[i + 4]]
            ^ t[2, data[i + 5]]
            ^ t[1, data[i + 6]]
            ^ t[0, data[i + 7]]
        )
        i += 8
    while i < n:
        crc = t[0, (crc ^ np.uint32(data[i])) & np.uint32(0xFF)] ^ (crc >> np.uint32(8))
        i += 1
    return crc ^ np.uint32(0xFFFFFFFF)


def crc32c(data: bytes) -> int:
    """CRC-32C (Castagnoli) of the bytes."""
    return int(_crc32c(np.frombuffer(data, np.uint8), _TABLES))


def masked_crc32c(data: bytes) -> int:
    """The CRC as TFRecord stores it."""
    crc = crc32c(data)
    return ((crc >> 15 | crc << 17) + _MASK_DELTA) & 0xFFFFFFFF


def framed(data: bytes) -> bytes:
    """One record with its length and checksums."""
    length = struct.pack("<Q", len(data))
    return length + struct.pack("<I", masked_crc32c(length)) + data + struct.pack("<I", masked_crc32c(data))


def is_header(header: bytes) -> bool:
    """True if these bytes begin a record whose length's checksum is right."""
    return len(header) >= HEADER_BYTES and struct.unpack("<I", header[8:12])[0] == masked_crc32c(header[:8])


def records(path: Path) -> Iterator[bytes]:
    """The records of a file, one at a time. InputError naming the file and the record that is damaged."""
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            number = 0
            while header := file.read(HEADER_BYTES):
                if not is_header(header):
                    raise InputError(f"{path}: record {number} has a damaged length; it is no TFRecord, or truncated")
                (length,) = struct.unpack("<Q", header[:8])
                if length > min(MAX_RECORD_BYTES, size):
                    raise InputError(f"{path}: record {number} claims {length} bytes; the file is truncated")
                data, check = file.read(length), file.read(4)
                if len(data) < length or len(check) < 4:
                    raise InputError(f"{path}: record {number} is truncated; get the file again")
                if struct.unpack("<I", check)[0] != masked_crc32c(data):
                    raise InputError(f"{path}: record {number} is damaged: its checksum differs; get the file again")
                yield data
                number += 1
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from error
    if number == 0:
        raise InputError(f"{path} is empty")
