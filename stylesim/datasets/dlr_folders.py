"""Folders of DLR's recordings: `trajectories_<begin>_<end>.csv[.gz]`."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from stylesim.errors import InputError

# Chosen: files whose names join within a minute are one continuous recording, hence one unit of splitting.
JOINED_WITHIN_S = 60.0


def track_files(path: Path, name: str) -> list[Path]:
    """The file itself, or the recordings in a folder in time; InputError where there is none, or one is there twice.

    `name` is the data set's, for the message.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise InputError(f"{path} does not exist; give a trajectories_*.csv.gz, or a folder of them")
    files = sorted([*path.glob("trajectories_*.csv.gz"), *path.glob("trajectories_*.csv")])
    if not files:
        raise InputError(f"{path} holds no trajectories_*.csv.gz; it is no folder of {name}")
    for one, other in pairwise(files):
        if one.name.split(".")[0] == other.name.split(".")[0]:
            raise InputError(f"{one} and {other} are the same recording; remove one of them")
    return files
