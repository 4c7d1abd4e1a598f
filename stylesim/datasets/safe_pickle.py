"""Pickles of strangers: numbers, text, containers and arrays; no name is ever imported, no code is ever run.

A pickle is a program. Here each global that it may name is mapped to a harmless stand-in of our own, everything
else is refused; arrays are built from their bytes by `numpy.frombuffer`, never by numpy's own unpickling, which
trusts what it reads. Before it runs, the program is looked through for numbers that would make it eat memory.
"""

from __future__ import annotations

import io
import pickle
import pickletools
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

MAX_DEPTH = 60  # chosen: a scenario nests some ten levels deep
_DTYPES = frozenset(["b1", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8"])
_MEMO = ("PUT", "BINPUT", "LONG_BINPUT")


class UnsafePickleError(ValueError):
    """The pickle names something that data do not need, or is built to do harm."""


class _Dtype:
    """What a pickled numpy.dtype says."""

    def __init__(self, code: Any = "", *_: Any) -> None:
        self.code, self.order = str(code), "<"

    def __setstate__(self, state: Any) -> None:
        self.order = str(state[1]) if isinstance(state, tuple) and len(state) > 1 else "<"

    def real(self) -> np.dtype[Any]:
        order = "<" if self.order in ("<", "|", "=") else ">"
        if self.code in _DTYPES:
            return np.dtype(order + self.code)
        if self.code[:1] in ("U", "S") and self.code[1:].isdigit() and 0 < int(self.code[1:]) <= 1 << 16:
            return np.dtype(order + self.code)
        raise UnsafePickleError(f"arrays of {self.code[:20]!r} are not read")


class _Array:
    """What a pickled numpy array says, until all of it is known."""

    state: Any = None

    def __setstate__(self, state: Any) -> None:
        self.state = state

    def real(self) -> Any:
        if not isinstance(self.state, tuple) or len(self.state) != 5:
            raise UnsafePickleError("an array without content")
        _, shape, dtype, fortran, raw = self.state
        if isinstance(raw, list):
            return raw  # an array of objects: its entries, in a list
        return _array(raw, dtype, shape, bool(fortran))


def _array(raw: Any, dtype: Any, shape: Any, fortran: bool) -> Any:
    if isinstance(raw, str):
        raw = raw.encode("latin-1")  # bytes, as Python 2 wrote them
    if not isinstance(dtype, _Dtype) or not isinstance(raw, bytes | bytearray) or not isinstance(shape, tuple):
        raise UnsafePickleError("an array that is none")
    if not all(isinstance(n, int) and 0 <= n <= 1 << 31 for n in shape) or len(shape) > 8:
        raise UnsafePickleError("an array of a shape that none has")
    if 0 in shape:
        return np.zeros(shape, dtype.real())
    return np.frombuffer(bytes(raw), dtype.real()).reshape(shape, order="F" if fortran else "C")


def _reconstruct(*_: Any) -> _Array:
    return _Array()


def _from_buffer(raw: Any, dtype: Any, shape: Any, order: Any = "C") -> Any:
    return _array(raw, dtype, shape, order == "F")


def _scalar(dtype: Any, raw: Any = b"") -> Any:
    value = _array(raw, dtype, (1,), False)
    return value[0].item()


def _mapping(*arguments: Any) -> dict[Any, Any]:
    """Stands for dict, OrderedDict, defaultdict (whose factory is dropped) and MetaDrive's own dictionary."""
    given = [a for a in arguments if isinstance(a, dict | list | tuple)]
    return dict(given[0]) if given else {}


class _Dictionary(dict):  # type: ignore[type-arg]
    """A dictionary whose pickled attributes are ignored."""

    def __new__(cls, *_: Any) -> _Dictionary:
        return super().__new__(cls)

    def __init__(self, *arguments: Any) -> None:
        super().__init__(_mapping(*arguments))

    def __setstate__(self, state: Any) -> None:
        pass


def _bytes(given: Any = b"", *_: Any) -> bytes:
    """Bytes of bytes or of text; of a number, which would reserve that many, none."""
    if isinstance(given, str):
        return given.encode("latin-1")
    return bytes(given) if isinstance(given, bytes | bytearray) else b""


_KNOWN: dict[tuple[str, str], Callable[..., Any] | type] = {
    ("numpy", "ndarray"): _Array,
    ("numpy", "dtype"): _Dtype,
    **{
        (module, name): stand_in
        for module in ("builtins", "__builtin__")
        for name, stand_in in (
            ("dict", _Dictionary),
            ("list", list),
            ("tuple", tuple),
            ("set", set),
            ("frozenset", frozenset),
            ("bytes", _bytes),
            ("bytearray", _bytes),
        )
    },
    ("_codecs", "encode"): _bytes,
    ("collections", "OrderedDict"): _Dictionary,
    ("collections", "defaultdict"): _Dictionary,
    ("metadrive.scenario.scenario_description", "ScenarioDescription"): _Dictionary,
    **{(f"numpy.{core}.multiarray", "_reconstruct"): _reconstruct for core in ("core", "_core")},
    **{(f"numpy.{core}.multiarray", "scalar"): _scalar for core in ("core", "_core")},
    **{(f"numpy.{core}.numeric", "_frombuffer"): _from_buffer for core in ("core", "_core")},
}


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        """Our stand-in for that name. UnsafePickleError for every other."""
        if (module, name) not in _KNOWN:
            raise UnsafePickleError(f"the pickle asks for {module}.{name}, which data do not need; it was not run")
        return _KNOWN[module, name]


def loads(raw: bytes) -> Any:
    """The data in a pickle. UnsafePickleError, or what the unpickler raises, where it is damaged or hostile."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # Python's word for an escape that no pickle is written with
        try:
            _looked_through(raw)
        except DeprecationWarning as warning:
            raise UnsafePickleError(f"the pickle is damaged: {warning}") from None
    return _plain(_Unpickler(io.BytesIO(raw)).load(), {}, 0)


def _looked_through(raw: bytes) -> None:
    """Refuse what makes an unpickler reserve memory for numbers that the file merely claims."""
    for count, (opcode, argument, _) in enumerate(pickletools.genops(raw)):
        if opcode.name in _MEMO and int(argument or 0) > 2 * count + 1000:
            raise UnsafePickleError("the pickle numbers its objects to fill memory")
        if opcode.name in ("LONG4", "LONG1", "LONG", "INT") and abs(int(argument or 0)) >> 128:
            raise UnsafePickleError("the pickle holds a number of more than 128 bits")


def _plain(value: Any, done: dict[int, Any], depth: int) -> Any:
    """Stand-ins replaced by what they stand for, in place where containers can change."""
    if depth > MAX_DEPTH:
        raise UnsafePickleError("the pickle is nested too deeply")
    if isinstance(value, str | int | float | bytes | np.ndarray | None):
        return value
    if id(value) in done:
        return done[id(value)][1]
    if isinstance(value, _Array):
        real = value.real()
        real = _plain(real, done, depth + 1) if isinstance(real, list) else real
        done[id(value)] = (value, real)
        return real
    if isinstance(value, dict):
        result: dict[Any, Any] = {}
        done[id(value)] = (value, result)
        result.update({_plain(k, done, depth + 1): _plain(v, done, depth + 1) for k, v in value.items()})
        return result
    if isinstance(value, list):
        entries: list[Any] = []
        done[id(value)] = (value, entries)
        entries.extend(_plain(v, done, depth + 1) for v in value)
        return entries
    if isinstance(value, tuple | set | frozenset):
        made = type(value)(_plain(v, done, depth + 1) for v in value)
        done[id(value)] = (value, made)
        return made
    raise UnsafePickleError(f"the pickle holds a {type(value).__name__}")
