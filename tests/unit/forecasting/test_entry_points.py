from __future__ import annotations

import sys
from pathlib import Path

import pytest

from stylesim.errors import InputError
from stylesim.forecasting.entry_points import from_entry_point, is_entry_point
from stylesim.forecasting.opening import open_forecaster

MODULE = """
from stylesim.forecasting.baselines import ConstantVelocity

class Mine(ConstantVelocity):
    name = "mine"

def factory():
    return Mine()

ready = Mine()
number = 3

def wrong():
    return 5

class Holder:
    make = Mine
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "my_model_xyz.py").write_text(MODULE)
    (tmp_path / "needs_more_xyz.py").write_text("import nowhere_to_be_found\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    for name in ("my_model_xyz", "needs_more_xyz"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize("attribute", ["factory", "Mine", "ready", "Holder.make"])
def test_a_factory_a_class_or_a_forecaster(folder: Path, attribute: str) -> None:
    assert from_entry_point(f"my_model_xyz:{attribute}").name == "mine"
    assert open_forecaster(f"my_model_xyz:{attribute}").name == "mine"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("my_modl_xyz:factory", "no module 'my_modl_xyz'"),
        ("my_model_xyz:fctory", "has no 'fctory'"),
        ("my_model_xyz:number", "neither a factory nor a forecaster"),
        ("my_model_xyz:wrong", "made a int"),
    ],
)
def test_what_is_wrong_is_named(folder: Path, name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        from_entry_point(name)


def test_a_missing_import_of_the_module_is_the_users_own_error(folder: Path) -> None:
    with pytest.raises(ModuleNotFoundError, match="nowhere_to_be_found"):
        from_entry_point("needs_more_xyz:factory")


def test_what_is_an_entry_point() -> None:
    assert is_entry_point("a.b:c.d")
    assert not is_entry_point("runs/model")
    assert not is_entry_point("constant_velocity")
