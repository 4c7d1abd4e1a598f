from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def world():
    """The module small_world.py beside this file (tests are no package)."""
    spec = importlib.util.spec_from_file_location("small_world", Path(__file__).parent / "small_world.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def small_corpus(world, tmp_path_factory):
    """40 simulated episodes of 6 agents, labelled."""
    return world.write(tmp_path_factory.mktemp("world") / "sim", [world.scene(e) for e in range(40)])
