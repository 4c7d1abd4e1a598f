"""Waymo Open Motion: 9 s scenarios at 10 Hz, as `Scenario` protos or as `tf.Example`, in TFRecord files.

One record is one scene, never recut; t0 is the record's current time (frame 10). The format does not say which
scenarios come from one drive, so each is a unit of its own; the official split is taken from the file's name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

from stylesim.datasets import wire
from stylesim.datasets.guarding import reading
from stylesim.datasets.sniffing import head, listed, matching
from stylesim.datasets.tfrecord import HEADER_BYTES, is_header, records
from stylesim.datasets.womd_example import scene_of_example
from stylesim.datasets.womd_scenario import scene_of_scenario
from stylesim.errors import InputError
from stylesim.scene import Scene

PATTERNS = ("*tfrecord*", "*/*tfrecord*")
_SPLITS = {"training": "train", "validation": "val", "testing": "test"}


def scenes(path: str | Path) -> Iterator[Scene]:
    """The scenarios of a TFRecord file, or of every one in a folder (and its folders), by name, then by record.

    InputError where there is none, or one is damaged; it names the file and the record.
    """
    for file in files(path):
        split = split_of(file.name)
        for number, data in enumerate(records(file)):
            where = f"scenario of Waymo Open Motion in record {number}"
            with reading(file, where):
                message = wire.fields(data, (0, len(data)))
                example = set(message) == {1} and len(message[1]) == 1 and not isinstance(message[1][0], int)
                if example:
                    scene = scene_of_example(data, message, file, f"{file.name.split('.')[0]}_{number:05d}", split)
                else:
                    scene = scene_of_scenario(data, message, file, split)
            yield scene


def files(path: str | Path) -> list[Path]:
    """The TFRecord files, each of which can be read alone; InputError where there is none."""
    found = _files(Path(path), listed)
    if not found:
        raise InputError(f"{path} holds no TFRecord file (*tfrecord*) of Waymo Open Motion")
    return found


def sniff(path: Path) -> bool:
    """True for a TFRecord file with a sound first header, or a folder with one."""
    found = [f for f in _files(path, matching) if f.suffix != ".json"]
    return bool(found) and is_header(head(found[0], HEADER_BYTES))


def _files(path: Path, find: Callable[..., list[Path]]) -> list[Path]:
    if path.is_file():
        return [path]
    return [file for file in find(path, *PATTERNS) if file.is_file() and file.suffix != ".json"]


def split_of(name: str) -> str:
    """The official split that a file of Waymo's is named after; "" where it is not."""
    found = re.search("|".join(_SPLITS), name)
    return _SPLITS[found.group()] if found else ""
