"""The folder that a training works in, and the record of what was asked, so that it goes on with the same."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stylesim.corpus.files import new_folder, write_whole
from stylesim.errors import InputError
from stylesim.forecasting.checkpoint import RECORD_FILE
from stylesim.forecasting.loop import STATE_FILE


def opened(out: Path, record: dict[str, Any], *, resume: bool) -> Path:
    """The folder OUT.partial to train in; InputError if `out` exists or what lies there was begun otherwise."""
    out, partial = new_folder(out)
    if resume and (partial / RECORD_FILE).exists():
        check_same(record, partial)
        return partial
    if any((partial / name).exists() for name in (STATE_FILE, "request.json")):  # epochs, or a corpus's parts
        raise InputError(f"{partial} is left from an unfinished run; add --resume to go on, or remove it")
    shutil.rmtree(partial, ignore_errors=True)
    write_json(partial / RECORD_FILE, record)
    return partial


@contextmanager
def forgotten_if_refused(folder: Path) -> Iterator[None]:
    """Removes a folder without a finished epoch where the data is refused: nothing in it could be resumed."""
    try:
        yield
    except InputError:
        if not (folder / STATE_FILE).exists():
            shutil.rmtree(folder)
        raise


def check_same(record: dict[str, Any], folder: Path) -> None:
    """InputError unless the training in `folder` was begun with the same settings."""
    path = folder / RECORD_FILE
    try:
        begun = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read ({error}); remove {folder} and start anew") from None
    for key, value in record.items():
        if begun.get(key) != value:
            raise InputError(f"{folder} was trained with {key} = {begun.get(key)}, not {value}; resume with the same")


def write_json(path: Path, content: dict[str, Any]) -> None:
    """A file of JSON, whole or not at all."""
    write_whole(path, json.dumps(content, indent=1, sort_keys=True).encode())
