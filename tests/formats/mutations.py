"""Damaged and hostile files: what bad copies, wrong units and ill will do to a data set."""

from __future__ import annotations

import copy
import gzip
import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
ODD = (
    b"nan", b"inf", b"-inf", b"1e308", b"1e999", b"-1", b"0", b"", b"abc", b"99999999999999999999", b"null", b"true",
    b"-0.0", b"1e-320", b'"', b"{", b"0x10", b"1,156", b"\xff\xfe", b"2147483648", b"-9223372036854775808",
)  # fmt: skip
# Feet, pixels, kilometres, degrees, 10 Hz taken for 1 Hz, microseconds for seconds, and sign.
FACTORS = (0.3048, 3.28084, 20.0, 1000.0, 0.001, 57.29578, 0.01745329, 0.1, 1e6, 1e-6, -1.0, 3.6)
TEXT = (".csv", ".json", ".txt", ".xml", ".osm", ".xodr", ".yaml")
ODD_VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 1 << 63, -(1 << 70), 1e308, float("nan"), float("inf"), "", "abc", [], {}, [[]], "1e5", 2.5,
    b"\x00", [None], {"x": "y"},
)  # fmt: skip


def mutate_files(folder: Path, rng: np.random.Generator) -> str:
    """Damage one file in `folder` at a random place; what was done, in words."""
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    file = files[int(rng.integers(len(files)))]
    raw = file.read_bytes()
    packed = file.suffix == ".gz" and rng.random() < 0.7
    name = file.with_suffix("") if packed else file
    plain = gzip.decompress(raw) if packed else raw
    if name.suffix in TEXT and rng.random() < 0.75:
        what, plain = _mutated_text(plain, rng)
    else:
        what, plain = _mutated_bytes(plain, rng)
    if what == "deleted":
        file.unlink()
    else:
        file.write_bytes(gzip.compress(plain, 1, mtime=0) if packed else plain)
    return f"{file.name}: {what}"


def _mutated_bytes(raw: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    n = max(len(raw), 1)
    at, length = int(rng.integers(n)), int(rng.integers(1, max(2, min(n, 200))))
    what = ("flip", "flip", "flip", "truncate", "cut", "double", "noise", "zero", "empty", "deleted")[rng.integers(10)]
    if what == "flip":
        array = bytearray(raw)
        for place in rng.integers(n, size=int(rng.integers(1, 9))).tolist():
            if place < len(array):
                array[place] ^= 1 << int(rng.integers(8))
        return what, bytes(array)
    changed = {
        "truncate": raw[:at],
        "cut": raw[:at] + raw[at + length :],
        "double": raw[: at + length] + raw[at:],
        "noise": raw[:at] + rng.bytes(length) + raw[at + length :],
        "zero": raw[:at] + bytes(length) + raw[at + length :],
        "empty": b"",
        "deleted": raw,
    }
    return what, changed[what]


def _mutated_text(raw: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    what = ("number", "number", "scale", "fields", "line", "column")[rng.integers(6)]
    if what in ("number", "scale"):
        found = list(NUMBER.finditer(raw))
        if not found:
            return _mutated_bytes(raw, rng)
        hit = found[int(rng.integers(len(found)))]
        new = ODD[rng.integers(len(ODD))] if what == "number" else _times(hit[0], float(rng.choice(FACTORS)))
        return f"{what} {hit[0]!r} -> {new!r}", raw[: hit.start()] + new + raw[hit.end() :]
    lines = raw.split(b"\n")
    i, j = (int(k) for k in rng.integers(len(lines), size=2))
    if what == "fields":
        fields = lines[i].split(b",")
        a, b = (int(k) for k in rng.integers(len(fields), size=2))
        fields[a], fields[b] = fields[b], fields[a]
        lines[i] = b",".join(fields)
    elif what == "line":
        lines[i : i + 1] = ([], [lines[i]] * 2, [lines[j]], [lines[i][: len(lines[i]) // 2]])[rng.integers(4)]
    else:
        lines = _scaled_column(lines, rng)
    return what, b"\n".join(lines)


def _times(number: bytes, factor: float) -> bytes:
    return repr(float(number) * factor).encode()


def _scaled_column(lines: list[bytes], rng: np.random.Generator) -> list[bytes]:
    """One column of a table in other units, in all rows or from some row on (mixed units)."""
    width = lines[0].count(b",") + 1
    column, factor = int(rng.integers(width)), float(rng.choice(FACTORS))
    start = 1 if rng.random() < 0.7 else int(rng.integers(1, max(2, len(lines))))
    result = list(lines)
    for i in range(start, len(lines)):
        fields = lines[i].split(b",")
        if column < len(fields) and NUMBER.fullmatch(fields[column]):
            fields[column] = _times(fields[column], factor)
            result[i] = b",".join(fields)
    return result


def mutated_array(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """An array of numbers with some or all of its values damaged; its type may change too."""
    array = np.array(values)
    if array.dtype.kind not in "fiub" or array.size == 0:
        return array[: array.shape[0] // 2] if array.ndim else array
    what = rng.integers(8)
    if what == 0:
        return array.astype(np.float64) * float(rng.choice(FACTORS))
    if what == 1:
        return array[: int(rng.integers(array.shape[0] + 1))] if array.ndim else array
    if what == 2:
        return array.astype(np.float64).reshape(-1)
    if what == 3:
        return array[..., None] if rng.random() < 0.5 else array.T
    if what == 4:
        return array.astype(str) if rng.random() < 0.5 else array.astype(object)
    array = array.astype(np.float64)
    flat = array.reshape(-1)
    places = rng.integers(flat.size, size=int(rng.integers(1, 6)))
    flat[places] = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1.0, 0.0, 1e7, 3e9])
    if what == 5:
        start = int(rng.integers(flat.size))
        with np.errstate(over="ignore", invalid="ignore"):
            flat[start:] *= float(rng.choice(FACTORS))
    return array


def mutated_frame(frame: pl.DataFrame, rng: np.random.Generator) -> pl.DataFrame:
    """A table with one column or some rows damaged."""
    name = frame.columns[int(rng.integers(frame.width))]
    column = frame[name]
    what = rng.integers(7)
    if what == 0:
        return frame.drop(name)
    if what == 1:
        return pl.concat([frame, frame.sample(min(5, frame.height), seed=int(rng.integers(1 << 30)))])
    if what == 2:
        return frame.sample(fraction=1.0, shuffle=True, seed=int(rng.integers(1 << 30)))
    if what == 3:
        other = frame.columns[int(rng.integers(frame.width))]
        return frame.rename({name: other, other: name}) if name != other else frame.drop(name)
    if not column.dtype.is_numeric():
        kinds: tuple[Any, ...] = (None, "", "x" * 1000, 7)
        return frame.with_columns(pl.lit(kinds[rng.integers(4)]).alias(name))
    if what == 4:
        return frame.with_columns(pl.col(name).cast(pl.String))
    values = mutated_array(column.to_numpy(), rng)
    if values.ndim != 1 or len(values) != frame.height or values.dtype == object:
        return frame.head(frame.height // 2)
    return frame.with_columns(pl.Series(name, values))


def mutated_tree(tree: Any, rng: np.random.Generator) -> Any:
    """A tree of dicts, lists, arrays and scalars with one node damaged."""
    tree = copy.deepcopy(tree)
    paths = _paths(tree)
    parent, key = paths[int(rng.integers(len(paths)))]
    value = parent[key]
    what = rng.integers(6)
    if isinstance(value, np.ndarray) and what > 1:
        parent[key] = mutated_array(value, rng)
    elif what == 0 and isinstance(parent, dict):
        del parent[key]
    elif isinstance(value, int | float) and not isinstance(value, bool) and what > 2:
        parent[key] = value * float(rng.choice(FACTORS))
    elif isinstance(value, list) and value and what == 1:
        del value[int(rng.integers(len(value))) :]
    elif isinstance(value, list) and value and what == 2:
        value.append(copy.deepcopy(value[0]))
    else:
        parent[key] = ODD_VALUES[rng.integers(len(ODD_VALUES))]
    return tree


def _paths(tree: Any, limit: int = 5000) -> list[tuple[Any, Any]]:
    found: list[tuple[Any, Any]] = []
    queue = [tree]
    while queue and len(found) < limit:
        node = queue.pop(0)
        keys = list(node) if isinstance(node, dict) else range(len(node))
        for key in keys:
            found.append((node, key))
            if isinstance(node[key], dict | list):
                queue.append(node[key])
    return found
