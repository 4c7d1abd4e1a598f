"""JSON files that are one long list, read object by object in constant memory."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from stylesim.datasets.guarding import bounded

CHUNK_CHARS = 1 << 20
MAX_OBJECT_CHARS = 1 << 24  # chosen: one row of a table has some hundred characters
_BETWEEN = " \t\r\n,"


def objects(file: Path) -> Iterator[dict[str, Any]]:
    """The objects of the list in that file. InputError or ValueError where it is none."""
    bounded(file)
    decoder = json.JSONDecoder()
    with file.open(encoding="utf-8") as opened:
        text = opened.read(CHUNK_CHARS).lstrip()
        if not text.startswith("["):
            raise ValueError("it is no list")
        at, ended = 1, False
        while True:
            while at < len(text) and text[at] in _BETWEEN:
                at += 1
            if at < len(text) and text[at] == "]":
                return
            try:
                value, at = decoder.raw_decode(text, at) if at < len(text) else (None, at)
            except json.JSONDecodeError:
                value = None
                if ended or len(text) - at > MAX_OBJECT_CHARS:
                    raise
            if value is None:
                if ended:
                    raise ValueError("the list is cut off")
                more = opened.read(CHUNK_CHARS)
                text, at, ended = text[at:] + more, 0, not more
            elif not isinstance(value, dict):
                raise ValueError("an entry of the list is no object")
            else:
                yield value
