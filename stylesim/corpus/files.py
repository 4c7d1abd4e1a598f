"""Files that appear under their final name only when whole, and their checksums."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from stylesim.errors import CorpusError, InputError


def sha256_of(path: Path) -> str:
    """Hex sha256 of a file, read in blocks."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def write_whole(path: Path, content: bytes) -> str:
    """Write `content` to `path` so that it appears whole or not at all; returns its sha256.

    CorpusError if the disk is full or the folder cannot be written; nothing is left under any name then.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(content)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise storage_error(error, path) from error
    return hashlib.sha256(content).hexdigest()


def storage_error(error: OSError, path: Path) -> CorpusError:
    """What to tell a user whose disk refused a write."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return CorpusError(
            f"the disk is full: could not write {path}. Free some space and repeat the command "
            "(a verb that has --resume goes on with it from what was finished)."
        )
    return CorpusError(f"could not write {path}: {error.strerror or error}")


def new_folder(out: str | Path) -> tuple[Path, Path]:
    """`out` and the name of the folder that it is built in, OUT.partial.

    InputError if something has the name `out` already, or it is no name at all (empty, "." or "/").
    """
    path = Path(out)
    if not path.name:
        raise InputError(f"--out {str(out)!r} is no name for a new folder; give one such as runs/first")
    if path.exists() or path.is_symlink():
        raise InputError(f"{path} is there already; choose another --out, or remove it first")
    return path, path.with_name(path.name + ".partial")


def json_bytes(value: Mapping[str, Any]) -> bytes:
    """`value` as JSON with sorted keys; the same value gives the same bytes."""
    return (json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n").encode()


def inside(folder: Path, relative: str) -> Path:
    """`folder / relative`; CorpusError if that path leaves the folder (absolute, or with ..)."""
    pure = PurePosixPath(relative)
    if pure.is_absolute() or ".." in pure.parts or "\\" in relative:
        raise CorpusError(f"{folder}: the file name {relative!r} leaves the corpus; refusing to touch it")
    return folder / pure
