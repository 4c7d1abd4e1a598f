from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from stylesim.evaluation.evaluate import evaluate

WORLD = Path(__file__).parents[1] / "evaluation" / "small_world.py"


@pytest.fixture(scope="session")
def world():
    spec = importlib.util.spec_from_file_location("small_world", WORLD)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def hostile_corpus(world, tmp_path_factory):
    """Scenes whose ids are markup, and a source that a formula sign could break."""
    scenes = [world.scene(e, scene_id=f"<script>alert({e})</script>$x_{e}") for e in range(36)]
    return world.write(tmp_path_factory.mktemp("report") / "sim & more", scenes)


@pytest.fixture(scope="session")
def evaluations(world, hostile_corpus):
    by = ("tdbm", "tdbm*scenario", "scenario")
    first = evaluate(world.ConstantVelocity(), hostile_corpus, by=by)
    return [first, evaluate(world.ConstantVelocity((1.0, 0.9, 1.1), name="<img src=x>$fan"), hostile_corpus, by=by)]
