"""Which foreign formats can be read, what each of them offers, and which of them a path holds."""

from __future__ import annotations

from pathlib import Path

from stylesim.datasets import formats_driving, formats_recorded
from stylesim.datasets.format import DatasetFormat
from stylesim.errors import InputError, unknown

AUTO = "auto"
FORMATS: dict[str, DatasetFormat] = {f.name: f for f in (*formats_driving.FORMATS, *formats_recorded.FORMATS)}


def dataset_format(name: str) -> DatasetFormat:
    """The format of that name; InputError naming the nearest known one if there is none."""
    if name not in FORMATS:
        raise unknown("data format", name, [*FORMATS, AUTO])
    return FORMATS[name]


def recognised(path: str | Path) -> DatasetFormat:
    """The one format that a file or folder looks like.

    InputError where the path does not exist, or no format or more than one knows it.
    """
    source = Path(path)
    if not source.exists():
        raise InputError(f"{source} does not exist")
    found = [f for f in FORMATS.values() if f.sniff(source)]
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(f.name for f in found)
        raise InputError(f"{source} looks like {names}; say which: stylesim read FORMAT {source} …")
    raise InputError(
        f"{source} is of no format that is recognised by its files ({', '.join(FORMATS)}); "
        "`stylesim datasets` says what each of them consists of"
    )
