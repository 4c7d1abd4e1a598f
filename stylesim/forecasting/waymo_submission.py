"""Waymo prediction files: serialised `MotionChallengeSubmission` messages, one file or a .tar.gz of them.

Field numbers by waymo_open_dataset/protos/motion_submission.proto (Apache-2.0): submission {1: scenario}, scenario
{1: id, 2: single {1: object}, 3: joint {1: mode}}, object {1: id, 2: scored {1: trajectory, 2: confidence}}, joint mode
{2: (id 1, trajectory 2), 3: confidence}, trajectory {2: x, 3: y}. 16 points at 2 Hz, the first 0.5 s after t0.
"""

from __future__ import annotations

import gzip
import tarfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.wire import Fields, Span, WireError, fields, integer, real, spans, text
from stylesim.errors import InputError
from stylesim.forecasting.predictions import ANY_T0, Key, PredictionFile, collected

DT_S = 0.5
LARGEST_BYTES = 2 << 30  # of one message, unpacked; chosen: the validation set of 44,000 scenes is about 0.5 GB
GZIP_MAGIC = b"\x1f\x8b"

Row = tuple[Key, Float64[np.ndarray, "step 2"], float]


def waymo_predictions(path: Path) -> PredictionFile:
    """The predictions in that file. InputError where it is no submission."""
    rows: list[Row] = []
    try:
        for data in _messages(path):
            rows.extend(_rows(data, str(path)))
    except (WireError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is no Waymo motion submission: {error}") from None
    return PredictionFile(path.name.split(".")[0], collected(rows, where=str(path)), dt_s=DT_S)


def _messages(path: Path) -> Iterator[bytes]:
    """The serialised messages of the file; members of an archive are read in memory and never unpacked to disk."""
    try:
        if tarfile.is_tarfile(path):
            with tarfile.open(path) as archive:
                for member in archive:
                    handle = archive.extractfile(member) if member.isfile() else None
                    if handle is not None:
                        yield _bounded(handle.read(LARGEST_BYTES + 1), path)
            return
        with path.open("rb") as raw:
            packed = raw.read(2) == GZIP_MAGIC
        with gzip.open(path, "rb") if packed else path.open("rb") as stream:
            yield _bounded(stream.read(LARGEST_BYTES + 1), path)
    except (tarfile.TarError, EOFError, zlib.error, OSError) as error:
        raise InputError(f"{path} cannot be read: {error}") from None


def _bounded(data: bytes, path: Path) -> bytes:
    if len(data) > LARGEST_BYTES:
        raise InputError(f"{path}: a message of more than {LARGEST_BYTES >> 30} GiB; split the submission")
    return data


def _rows(data: bytes, where: str) -> Iterator[Row]:
    for span in spans(fields(data, (0, len(data))), 1):
        scenario = fields(data, span)
        name = text(data, scenario, 1)
        if not name:
            raise InputError(f"{where}: a scenario has no id")
        for single in spans(scenario, 2):
            for item in spans(fields(data, single), 1):
                yield from _single(data, fields(data, item), name)
        for joint in spans(scenario, 3):
            for item in spans(fields(data, joint), 1):
                yield from _joint(data, fields(data, item), name)


def _single(data: bytes, item: Fields, scenario: str) -> Iterator[Row]:
    key = (scenario, str(integer(item, 1, -1)), ANY_T0)
    for span in spans(item, 2):
        scored = fields(data, span)
        for trajectory in spans(scored, 1):
            yield key, _trajectory(data, trajectory), real(data, scored, 2, 1.0)


def _joint(data: bytes, mode: Fields, scenario: str) -> Iterator[Row]:
    """A joint mode counts as one mode of each of its objects, with the joint confidence."""
    for span in spans(mode, 2):
        item = fields(data, span)
        for trajectory in spans(item, 2):
            key = (scenario, str(integer(item, 1, -1)), ANY_T0)
            yield key, _trajectory(data, trajectory), real(data, mode, 3, 1.0)


def _trajectory(data: bytes, span: Span) -> Float64[np.ndarray, "step 2"]:
    found = fields(data, span)
    x, y = (_floats(data, found, number) for number in (2, 3))
    if len(x) != len(y):
        raise WireError("x and y of a trajectory differ in length")
    return np.stack([x, y], axis=1)


def _floats(data: bytes, message: Fields, number: int) -> Float64[np.ndarray, " value"]:
    """A repeated float field, packed or not."""
    joined = b"".join(data[start:end] for start, end in spans(message, number))
    if len(joined) % 4:
        raise WireError(f"field {number} is no list of floats")
    return np.frombuffer(joined, "<f4").astype(np.float64)
