"""Simulated traffic: backends, workers, `generate`. Importing this package loads no simulator."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    """`generate` and `realised_styles`, imported when they are first asked for."""
    if name in ("generate", "realised_styles"):
        from importlib import import_module

        return getattr(import_module("stylesim.simulation.generate"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
