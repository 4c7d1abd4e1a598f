"""Backends are opened by name, lazily, and say what is missing."""

from __future__ import annotations

import builtins
import subprocess
import sys
from types import ModuleType
from typing import Any

import pytest

from stylesim.errors import InputError, MissingDependencyError
from stylesim.simulation.backend import open_backend


def test_unknown_backend_names_the_nearest() -> None:
    with pytest.raises(InputError, match="Did you mean 'sumo'"):
        open_backend("summo")


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ModuleNotFoundError("No module named 'libsumo'"), r"pip install 'stylesim\[sumo\]'"),
        (ImportError("libX11.so.6: cannot open shared object file"), "libX11 libXext libXrender libGL libatomic"),
    ],
)
def test_a_libsumo_that_cannot_be_imported_names_the_fix(
    error: Exception, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def without_libsumo(name: str, *args: Any, **kwargs: Any) -> ModuleType:
        if name == "libsumo":
            raise error
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_libsumo)
    with pytest.raises(MissingDependencyError, match=said):
        open_backend("sumo")


def test_importing_the_package_loads_no_simulator() -> None:
    code = "import sys, stylesim.simulation.sumo, stylesim.simulation.backend; assert 'libsumo' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
