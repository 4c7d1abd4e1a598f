"""`stress` as a user meets it, on a corpus of his own (simulating the edge cases takes minutes)."""

from __future__ import annotations

import json

from tests.unit.cli.conftest import write_corpus


def test_a_report_of_two_forecasters(stylesim, tmp_path):
    corpus = write_corpus(tmp_path / "corpus", 24)
    out = tmp_path / "stress"
    said = stylesim("stress", "constant_velocity", "lane_following", "--corpus", corpus, "--out", out)
    assert said.code == 0, said.err
    page = (out / "report.html").read_text()
    assert all(word in page for word in ("Worst group", "Does it know?", "When something happens"))
    raw = json.loads((out / "lane_following.stress.json").read_text())
    assert raw["accuracy"]["slices"][0]["metrics"]["min_fde_m"]["n_drivers"] > 30
    said = stylesim("compare", out / "lane_following.json", out / "constant_velocity.json", "--by", "scenario")
    assert "lane_following minus constant_velocity" in said.out
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
