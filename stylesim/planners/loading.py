"""A planner by its entry point."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from stylesim.errors import InputError, unknown

ENTRY_POINT = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")


def checked_entry_point(entry_point: str) -> tuple[str, str]:
    """Module and name; InputError for anything but `package.module:name`."""
    if not ENTRY_POINT.fullmatch(entry_point):
        raise InputError(f"planner {entry_point!r}: expected package.module:name, e.g. stylesim.planners:IdmPlanner")
    module, _, name = entry_point.partition(":")
    return module, name


def planner_source(entry_point: str) -> Path | None:
    """The file of the planner's module, None where it has none. InputError where there is no such module."""
    module, _ = checked_entry_point(entry_point)
    _here_is_importable()
    try:
        spec = find_spec(module)
    except (ImportError, ValueError) as error:
        raise InputError(f"planner {entry_point!r}: {module} cannot be found: {error}") from error
    if spec is None:
        raise InputError(f"planner {entry_point!r}: there is no module {module!r} (looked in {Path.cwd()}, too)")
    return Path(spec.origin) if spec.origin and Path(spec.origin).is_file() else None


def load_planner(entry_point: str) -> Callable[[], Callable[..., Any]]:
    """What makes the planner of one episode: a class is made anew for each, a function is the planner itself.

    The current directory is importable. InputError where module or name are not there, or it cannot be called.
    """
    module, name = checked_entry_point(entry_point)
    planner_source(entry_point)
    try:
        found = import_module(module)
    except Exception as error:  # whatever the user's module raises
        raise InputError(
            f"planner {entry_point!r}: importing {module} failed: {type(error).__name__}: {error}"
        ) from error
    if not hasattr(found, name):
        public = [key for key, value in vars(found).items() if callable(value) and not key.startswith("_")]
        raise unknown("planner", name, public, where=module)
    value = getattr(found, name)
    if not callable(value):
        raise InputError(f"planner {entry_point!r} is a {type(value).__name__} and cannot be called")
    if inspect.isclass(value):
        return lambda: _made(value, entry_point)
    return lambda: value


def _made(kind: type, entry_point: str) -> Callable[..., Any]:
    try:
        planner = kind()
    except Exception as error:  # whatever the user's class raises
        raise InputError(f"planner {entry_point!r} cannot be made: {type(error).__name__}: {error}") from error
    if not callable(planner):
        raise InputError(f"planner {entry_point!r}: its class has no __call__(scene)")
    return planner


def _here_is_importable() -> None:
    here = str(Path.cwd())
    if here not in sys.path and "" not in sys.path:
        sys.path.insert(0, here)
