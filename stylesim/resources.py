"""Where the data folders `scenarios/` and `agents/` are, in a wheel and in a checkout."""

from __future__ import annotations

import os
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def data_root() -> Path:
    """The folder that holds `scenarios/` and `agents/`: `stylesim/data` in a wheel, else the checkout's root."""
    bundled = _PACKAGE / "data"
    return bundled if bundled.is_dir() else _PACKAGE.parent


def scenarios_dir() -> Path:
    """The folder of scenario families, one folder each."""
    return data_root() / "scenarios"


def agents_dir() -> Path:
    """The folder of `styles.yaml` and the populations."""
    return data_root() / "agents"


def cache_dir() -> Path:
    """Where compiled networks are kept: `$STYLESIM_CACHE`, else the user's cache folder."""
    chosen = os.environ.get("STYLESIM_CACHE")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "stylesim"
