"""The whole way by command line: generate, label, merge, train, evaluate, verify, render, join."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

from stylesim.corpus import Corpus


def stylesim(*argv: object, code: int = 0) -> str:
    """stdout of the command, stderr where it shall fail; its stderr in the failure if it ends otherwise."""
    program = "from stylesim.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", program, *map(str, argv)], capture_output=True, text=True, check=False)
    assert done.returncode == code, f"{argv}\n{done.stdout}\n{done.stderr}"
    return done.stderr if code else done.stdout


def the_whole_way(folder: Path, scenario: str, *, condition: str, episodes: int) -> None:
    sim, mixed, model = folder / "sim", folder / "mixed", folder / "model"
    stylesim("generate", scenario, "--episodes", episodes, "--seed", 7, "--out", sim)
    assert "sound" in stylesim("verify", sim)
    assert "aggressive" in stylesim("label", sim)
    stylesim("merge", sim, "--split", "0.34,0.33,0.33", "--balance", "tdbm", "--out", mixed)
    assert {info.split for info in Corpus(mixed).info} == {"train", "val", "test"}
    short = ("--epochs", 1, "--max-steps", 3)
    rare = ("--robust", "balanced,jtt", "--augment", sim, "--augment-share", 0.25)
    stylesim("train", mixed, "--condition", condition, *short, "--out", model)
    said = stylesim("train", mixed, *rare, *short, "--out", folder / "robust", code=2)
    assert "no scene to add" in said  # the mixed corpus holds the same episodes
    stylesim("train", mixed, *rare[:2], *short, "--out", folder / "robust")
    assert set(json.loads((folder / "robust" / "training.json").read_text())["groups"])
    said = stylesim("evaluate", "constant_velocity", model, mixed, "--by", "tdbm,scenario", "--out", folder / "report")
    assert "minFDE" in said
    assert {"report.html", "constant_velocity.json"} <= {path.name for path in (folder / "report").iterdir()}
    assert json.loads((folder / "report" / "constant_velocity.json").read_text())["slices"]
    stylesim("render", mixed, "--out", folder / "scene.png")
    assert (folder / "scene.png").read_bytes().startswith(b"\x89PNG")
    stylesim("labels", sim, "--join", folder / "labels.csv")
    rows = list(csv.DictReader((folder / "labels.csv").read_text().splitlines()))
    assert {row["source_scenario_id"] for row in rows} == {info.source_scenario_id for info in Corpus(sim).info}


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["highway", "yellow_light"])
def test_the_whole_way(scenario, tmp_path, monkeypatch):
    monkeypatch.setenv("STYLESIM_CACHE", str(tmp_path / "cache"))
    the_whole_way(tmp_path, scenario, condition="tdbm", episodes=3)


def test_generate_verify_and_list(tmp_path):
    stylesim("generate", "highway", "--episodes", 1, "--out", tmp_path / "sim")
    assert "sound" in stylesim("verify", tmp_path / "sim")
    assert "highway" in stylesim("list", "scenarios")


@pytest.mark.slow
def test_the_placebo_test_runs_and_says_what_it_could_show(tmp_path, monkeypatch):
    """Three steps teach nothing: the positive control must fail, and with it the test, whatever else it says."""
    monkeypatch.setenv("STYLESIM_CACHE", str(tmp_path / "cache"))
    worlds = []
    for crowd in ("placebo", "tdbm_spectrum"):
        raw, mixed = tmp_path / f"{crowd}-raw", tmp_path / crowd
        stylesim("generate", "highway", "--population", crowd, "--episodes", 12, "--seed", 7, "--out", raw)
        stylesim("merge", raw, "--split", "0.5,0.2,0.3", "--out", mixed)
        worlds.append(mixed)
    short = ("--seeds", 2, "--steps", 3, "--size", "mini", "--stride", 12)
    stylesim("placebo", *worlds, *short, "--out", tmp_path / "test", code=1)
    found = json.loads((tmp_path / "test" / "placebo.json").read_text())
    assert not found["passed"]
    assert [check["arm"] for check in found["checks"]] == ["tdbm", "oracle", "oracle", "oracle", "oracle+permuted"]
    assert all(check["change"]["n_seeds"] == 2 for check in found["checks"])
    control = found["checks"][2]
    assert control["world"] == "control" and not control["passed"]
    said = stylesim("placebo", *reversed(worlds), *short, "--out", tmp_path / "other", code=2)
    assert "is no placebo" in said
