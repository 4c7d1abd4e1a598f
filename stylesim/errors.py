"""Errors that a user can act on: what is wrong, where, and what to do next."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path


class StylesimError(Exception):
    """Base of every error that stylesim raises on purpose; the CLI prints it without a traceback."""

    exit_code = 2


class InputError(StylesimError):
    """What the user asked for, or a file that he gave, is not usable."""


class CorpusError(StylesimError):
    """A corpus on disk is missing, incomplete, damaged, or of a newer schema."""

    exit_code = 3


class SimulationError(StylesimError):
    """A simulator refused a scenario, or the process that ran it died."""

    exit_code = 4


class MissingDependencyError(StylesimError):
    """An optional part of stylesim is not installed, or a system library is missing."""

    exit_code = 5


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name most like `name`, or None where nothing is alike."""
    matches = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)
    return matches[0] if matches else None


def unknown(what: str, name: str, known: Iterable[str], *, where: str | Path | None = None) -> InputError:
    """An InputError for an unknown name that names the nearest known one, and all of them."""
    names = sorted(known)
    guess = nearest(name, names)
    hint = f" Did you mean {guess!r}?" if guess else ""
    place = f" in {where}" if where is not None else ""
    return InputError(f"unknown {what} {name!r}{place}.{hint} Known: {', '.join(names)}.")
