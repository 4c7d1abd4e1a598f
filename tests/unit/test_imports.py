"""`import stylesim` must stay cheap: none of the heavy libraries may be loaded by it."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ["torch", "libsumo", "highway_env", "polars", "sklearn", "scipy", "numba", "pandas", "pygame", "matplotlib"]


def test_importing_the_package_loads_nothing_heavy():
    code = f"import sys, stylesim; print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_public_name_is_there():
    import stylesim

    for name in stylesim.__all__:
        assert getattr(stylesim, name) is not None
