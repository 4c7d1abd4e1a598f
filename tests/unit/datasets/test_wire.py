"""Messages with a field that repeats: split by compiled code as field by field, whatever the bytes are."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.datasets import wire

_compiling = settings(deadline=None)  # the first call compiles
_NUMBERS = st.integers(0, (1 << 64) - 1)


def _varint(value: int) -> bytes:
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def _field(number: int, value: int | bytes) -> bytes:
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    return _varint(number << 3 | 2) + _varint(len(value)) + value


@_compiling
@given(
    st.lists(
        st.one_of(st.tuples(st.integers(1, 40), _NUMBERS), st.tuples(st.just(3), st.binary(max_size=300))), max_size=30
    )
)
def test_nothing_is_lost(given_fields: list[tuple[int, int | bytes]]) -> None:
    sound = [(n, v) for n, v in given_fields if n != 3 or isinstance(v, bytes)]
    data = b"".join(_field(number, value) for number, value in sound)
    rest, found = wire.split(data, (0, len(data)), 3)
    assert [data[a:b] for a, b in found.tolist()] == [v for n, v in sound if n == 3]
    assert rest == {n: v for n, v in wire.fields(data, (0, len(data))).items() if n != 3}


@_compiling
@given(st.binary(max_size=60), st.integers(0, 10), st.integers(0, 60))
def test_any_bytes_are_split_as_they_are_read_one_by_one(data: bytes, start: int, end: int) -> None:
    end = min(end, len(data))
    span = (min(start, end), end)
    one_by_one, split = None, None
    with contextlib.suppress(wire.WireError):
        one_by_one = wire.fields(data, span)
        wire.spans(one_by_one, 3)
    with contextlib.suppress(wire.WireError):
        split = wire.split(data, span, 3)
    if split is not None:
        assert one_by_one is not None
        assert [tuple(s) for s in split[1].tolist()] == wire.spans(one_by_one, 3)
        assert {n: len(v) for n, v in split[0].items()} == {n: len(v) for n, v in one_by_one.items() if n != 3}
    elif one_by_one is not None:  # refused by both, but for a field 3 of four or eight bytes
        assert 3 in one_by_one or max(one_by_one, default=0) >= 1 << 59


@pytest.mark.parametrize("data", [b"\x1a\x05ab", b"\x1a", b"\x80", b"\x1b", b"\x1d\x00", b"\x08" + b"\xff" * 11])
def test_bytes_that_are_cut_off_are_refused(data: bytes) -> None:
    with pytest.raises(wire.WireError):
        wire.split(data, (0, len(data)), 3)
