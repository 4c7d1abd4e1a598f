"""`evaluate` of anybody's forecaster, `compare`, `conformal`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tests.unit.cli.conftest import write_corpus

FOREIGN = """
from stylesim.forecasting.arrays import FOOT_M, ArrayForecaster

def straight(arrays):
    return arrays["agent"][:, 0, None, -1, 2:4] * (0.5 * __import__("numpy").arange(1, 9))[:, None]

def factory():
    return ArrayForecaster("foreign", straight, dt_s=0.5, history_s=2.0, future_s=4.0, unit_m=FOOT_M)
"""


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    return write_corpus(tmp_path / "corpus", 60)


def test_a_foreign_model_beside_baselines_and_then_compared(stylesim, corpus, tmp_path, monkeypatch):
    (tmp_path / "their_adapter.py").write_text(FOREIGN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    names = ["their_adapter:factory", "lane_following", "idm_rollout", "kinematic_fan", "constant_velocity"]
    said = stylesim("evaluate", *names, corpus, "--by", "scenario", "--out", tmp_path / "report")
    sys.modules.pop("their_adapter", None)
    assert said.code == 0, said.err
    assert "judged up to 4 s, the horizon of foreign; 6 s were asked for" in said.out
    made = {path.stem for path in (tmp_path / "report").glob("*.json")}
    assert made == {"foreign", "lane_following", "idm_rollout", "kinematic_fan", "constant_velocity"}
    said = stylesim("compare", tmp_path / "report/foreign.json", tmp_path / "report/constant_velocity.json")
    assert said.code == 0
    assert "foreign minus constant_velocity" in said.out
    said = stylesim("compare", *(tmp_path / f"report/{n}.json" for n in ("foreign", "kinematic_fan")), "--by", "tdbm")
    assert said.code == 2
    assert "is not in both evaluations" in said.err


def test_conformal_radii_with_their_coverage(stylesim, corpus, tmp_path):
    out = tmp_path / "regions.json"
    said = stylesim("conformal", "constant_velocity", corpus, "--by", "scenario", "--alpha", "0.2", "--out", out)
    assert said.code == 0, said.err
    found = json.loads(out.read_text())
    assert found["regions"][0]["group"] == "all"
    assert found["regions"][0]["calibration_drivers"] >= 30
    assert stylesim("conformal", "constant_velocity", corpus, "--alpha", "2").code == 2
    assert "no tdbm labels" in stylesim("conformal", "constant_velocity", corpus).err


def test_a_fan_needs_a_training_split(stylesim, tmp_path):
    bare = write_corpus(tmp_path / "bare", 3, splits=False)
    said = stylesim("evaluate", "kinematic_fan", bare, "--split", "all", "--by", "scenario", "--out", tmp_path / "r")
    assert said.code == 2
    assert "fitted on a training split" in said.err
