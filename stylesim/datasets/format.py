"""`DatasetFormat`: what one foreign format offers, and how to reach its reader."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

from stylesim.scene import Scene


@dataclass(frozen=True)
class DatasetFormat:
    """One foreign format.

    `module` has `scenes(path, **options) -> Iterator[Scene]` and `sniff(path) -> bool`, which says cheaply, and
    without ever raising, whether a file or folder looks like this format. `tested_on` is "recorded files" where
    public bytes were at hand, "documentation" where the tests write files after the official description.
    """

    name: str
    module: str
    description: str
    rate_hz: float  # of the source; scenes are at `dt_s`
    has_map: bool
    has_signals: bool
    licence: str
    where: str
    supports: str = ""  # which files and versions, in one line
    tested_on: Literal["recorded files", "documentation"] = "recorded files"
    options: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()  # those of the options that are positive numbers
    dt_s: float = 0.1
    pieces: Literal["", "files", "large files"] = (
        ""  # `module.files(path)` lists what is read alone; large: many scenes
    )

    def scenes(self) -> Callable[..., Iterator[Scene]]:
        """The reader's `scenes` function; its module is imported now."""
        return cast("Callable[..., Iterator[Scene]]", importlib.import_module(self.module).scenes)

    def files(self, path: Path) -> Iterable[Path]:
        """The files (or folders) there that can be read alone, in their order; only where `pieces` says so."""
        return cast("Iterable[Path]", importlib.import_module(self.module).files(path))

    def sniff(self, path: Path) -> bool:
        """True if that file or folder looks like this format; cheap, never raises."""
        return cast("bool", importlib.import_module(self.module).sniff(path))
