"""`stress` as a user meets it, on a corpus of his own (simulating the edge cases takes minutes)."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from stylesim.corpus import CorpusWriter
from tests.conftest import make_scene
from tests.unit.cli.conftest import write_corpus
from tests.unit.forecasting.prediction_files import T0, av2_file, waymo_bytes


def test_a_report_of_two_forecasters(stylesim, tmp_path):
    corpus = write_corpus(tmp_path / "corpus", 24)
    out = tmp_path / "stress"
    said = stylesim("stress", "constant_velocity", "lane_following", "--corpus", corpus, "--out", out)
    assert said.code == 0, said.err
    page = (out / "report.html").read_text()
    assert all(word in page for word in ("Worst group", "Does it know?", "When something happens", "When it is close"))
    times = json.loads((out / "latency.json").read_text())
    assert set(times) == {"constant_velocity", "lane_following"}
    assert times["lane_following"]["cpu_p95_ms"] > 0
    raw = json.loads((out / "lane_following.stress.json").read_text())
    assert raw["accuracy"]["slices"][0]["metrics"]["min_fde_m"]["n_drivers"] > 30
    pair = [out / f"{name}.stress.json" for name in ("lane_following", "constant_velocity")]
    page, figures = tmp_path / "compare.html", tmp_path / "compare.json"
    said = stylesim("compare", *pair, "--report", page, "--out", figures)
    assert said.code == 0, said.err
    assert "lane_following minus constant_velocity, by commanded*scenario" in said.out
    assert "lane_following against constant_velocity" in page.read_text()
    cells = json.loads(figures.read_text())["cells"]
    assert set(cells) == {"all", "commanded", "scenario", "commanded*scenario"}
    ours, theirs = (json.loads(path.read_text())["accuracy"]["slices"][0]["metrics"]["min_fde_m"] for path in pair)
    assert cells["all"]["all"]["min_fde_m"]["value"] == pytest.approx(ours["value"] - theirs["value"])
    mixed = stylesim("compare", pair[0], out / "constant_velocity.json")
    assert mixed.code == 2
    assert "one is a stress test" in mixed.err
    (out / "lane_following.decisions.parquet").unlink()
    assert "keep both together" in stylesim("compare", *pair).err
    again = stylesim("stress", "constant_velocity", "--corpus", corpus, "--out", out)
    assert again.code == 2
    assert "is there already" in again.err


def test_bad_input_leaves_nothing(stylesim, tmp_path):
    corpus = write_corpus(tmp_path / "corpus", 4)
    out = tmp_path / "stress"
    assert stylesim("stress", "constant_velocty", "--corpus", corpus, "--out", out).code == 2
    twice = stylesim("stress", "constant_velocity", "constant_velocity", "--corpus", corpus, "--out", out)
    assert twice.code == 2
    assert "different names" in twice.err
    assert not out.exists()
    assert not out.with_name("stress.partial").exists()


def test_every_baseline_can_be_examined(stylesim, tmp_path):
    """The fan is fitted on the train split; the test split is examined."""
    corpus = write_corpus(tmp_path / "corpus", 60)
    names = ["constant_velocity", "constant_turn_rate", "lane_following", "idm_rollout", "kinematic_fan"]
    said = stylesim("stress", *names, "--corpus", corpus, "--split", "test", "--out", tmp_path / "stress")
    assert said.code == 0, said.err
    found = json.loads((tmp_path / "stress" / "kinematic_fan.stress.json").read_text())
    assert found["accuracy"]["about"]["corpus"]["splits"] == {"test": 10}


def test_a_fan_is_not_fitted_on_what_it_is_examined_on(stylesim, tmp_path):
    bare = write_corpus(tmp_path / "bare", 24, splits=False)
    ask = ("stress", "kinematic_fan", "--corpus", bare, "--out", tmp_path / "stress")
    said = stylesim(*ask)
    assert said.code == 2
    assert "--fit-on" in said.err
    assert "one corpus" in stylesim(*ask, "--fit-on", bare).err
    other = write_corpus(tmp_path / "other", 12)
    assert stylesim(*ask, "--fit-on", other).code == 0


def test_prediction_files_are_examined_without_any_code(stylesim, tmp_path):
    """One of each benchmark: both know the truth; Waymo's speaks of half of the drivers only, at 2 Hz."""
    scenes = []
    with CorpusWriter(tmp_path / "corpus", source="made", configuration={}) as writer:
        for i in range(16):
            scene = make_scene(f"scene-{i}", seed=i, n_agents=4, n_frames=130)
            # Waymo's track ids are numbers, and its frames local: 32 bits cannot hold a zone's coordinates
            tracks = replace(scene.tracks, agent_id=tuple("0123"), origin_m=np.array([1000.0, -2000.0]))
            scenes.append(replace(scene, source_scenario_id=f"scenario-{i}", t0_frame=T0, tracks=tracks))
            writer.add(scenes[-1])
        writer.finish()
    theirs = av2_file(tmp_path / "theirs.parquet", scenes, [0, 1, 2])
    half = tmp_path / "half.binproto"
    half.write_bytes(b"".join(waymo_bytes(scene, [0, 2]) for scene in scenes))
    out = tmp_path / "stress"
    said = stylesim("stress", theirs, half, "constant_velocity", "--corpus", tmp_path / "corpus", "--out", out)
    assert said.code == 0, said.err
    found = {
        name: json.loads((out / f"{name}.stress.json").read_text()) for name in ("theirs", "half", "constant_velocity")
    }
    overall = {name: one["accuracy"]["slices"][0]["metrics"] for name, one in found.items()}
    for name in ("theirs", "half"):
        assert overall[name]["min_fde_m"]["value"] == pytest.approx(0, abs=2e-3)  # of files in mm
        assert overall[name]["min_fde_m"]["n_drivers"] == 32  # what all of them can answer
    assert overall["half"]["min_ade_m"]["value"] < 0.2  # a line between points 0.5 s apart
    assert overall["theirs"]["top_fde_m"]["value"] == pytest.approx(50**0.5, abs=2e-3)  # the likelier mode is beside
    assert overall["constant_velocity"]["min_fde_m"]["value"] > 1
    assert found["theirs"]["reliability"][0]["expected_calibration_error"]["value"] == pytest.approx(0.75)
    assert found["half"]["reliability"] == []  # one mode
    assert found["theirs"]["accuracy"]["counts"]["not forecast by all"] == 16
    assert "theirs" in (out / "report.html").read_text()
    for damaged in (theirs, half):
        damaged.write_bytes(damaged.read_bytes()[:-7])
        again = stylesim("stress", damaged, "--corpus", tmp_path / "corpus", "--out", tmp_path / "again")
        assert again.code == 2
        assert damaged.name in again.err
        assert not (tmp_path / "again").exists()


def test_the_same_examination_has_the_same_bytes(stylesim, tmp_path):
    corpus = write_corpus(tmp_path / "corpus", 12)
    for name in ("one", "two"):
        assert stylesim("stress", "lane_following", "--corpus", corpus, "--out", tmp_path / name).code == 0
    made = sorted(
        path.name for path in (tmp_path / "one").iterdir() if path.name not in ("latency.json", "report.html")
    )
    assert "lane_following.stress.json" in made
    for name in made:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes(), name
