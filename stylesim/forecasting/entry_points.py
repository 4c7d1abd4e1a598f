"""A forecaster of the user's own by entry point: `pkg.module:factory`."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path
from typing import Any

from stylesim.errors import InputError
from stylesim.forecast import Forecaster

ENTRY_POINT = re.compile(r"^[A-Za-z_][\w.]*:[A-Za-z_][\w.]*$")
CONTRACT = "a forecaster has a `name` and `predict(tasks)` (stylesim.forecast.Forecaster)"


def is_entry_point(name: str) -> bool:
    """True for `pkg.module:factory`."""
    return ENTRY_POINT.match(name) is not None


def from_entry_point(name: str) -> Forecaster:
    """What the factory makes, called without arguments; a forecaster itself may stand there, too.

    The working directory is searched first, as `python -m` does: a script beside the user's data is enough. This runs
    the user's code, which he named. InputError where the module or name is missing, or it makes no forecaster.
    """
    module_name, _, attribute = name.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        found: Any = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is None or not (module_name == error.name or module_name.startswith(f"{error.name}.")):
            raise  # something that the user's module needs: his traceback says it best
        raise InputError(
            f"{name}: no module {error.name!r} in {here} or among the installed packages; "
            "run from the folder that holds it, or install it"
        ) from None
    for part in attribute.split("."):
        if not hasattr(found, part):
            raise InputError(f"{name}: {module_name} has no {attribute!r}")
        found = getattr(found, part)
    if isinstance(found, type) or not isinstance(found, Forecaster):
        if not callable(found):
            raise InputError(f"{name} is neither a factory nor a forecaster; {CONTRACT}")
        found = found()
    if not isinstance(found, Forecaster) or not isinstance(found.name, str) or not found.name:
        raise InputError(f"{name} made a {type(found).__name__}, which is no forecaster; {CONTRACT}")
    return found
