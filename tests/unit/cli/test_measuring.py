"""The verbs that measure, as a user meets them."""

from __future__ import annotations

import json

from stylesim.corpus import CorpusWriter
from tests.conftest import make_scene


def test_fidelity_of_a_corpus_and_a_wrong_ending(stylesim, tmp_path):
    path = tmp_path / "sim"
    with CorpusWriter(path, source="made", configuration={}, seed=1) as writer:
        for i in range(6):
            writer.add(make_scene(f"s{i}", n_agents=9, n_frames=230, seed=i, source="sumo"))
        writer.finish()
    wrong = stylesim("fidelity", path, "--out", tmp_path / "f.csv")
    assert wrong.code == 2 and ".json" in wrong.err
    said = stylesim("fidelity", path, "--no-robustness", "--out", tmp_path / "f.json")
    assert said.code == 0
    assert "balanced" in said.out and "Who is not judged" in said.out
    assert json.loads((tmp_path / "f.json").read_text())["format"] == "stylesim-fidelity"


def test_criticality_of_a_corpus_without_styles_or_population(stylesim, tmp_path):
    path = tmp_path / "sim"
    with CorpusWriter(path, source="made", configuration={}, seed=1) as writer:
        for i in range(4):
            writer.add(make_scene(f"s{i}", n_agents=9, n_frames=120, seed=i))
        writer.finish()
    no_population = stylesim("criticality", path, "--as-population", "naturalistic")
    assert no_population.code == 2 and "names no population" in no_population.err
    no_labels = stylesim("criticality", path, "--by", "tdbm")
    assert no_labels.code == 2 and "label" in no_labels.err
    said = stylesim("criticality", path, "--out", tmp_path / "c.json")
    assert said.code == 0 and "Per 1,000 km" in said.out
    assert json.loads((tmp_path / "c.json").read_text())["format"] == "stylesim-criticality"


def test_realism_of_two_corpora_and_wrong_endings(stylesim, tmp_path):
    paths = []
    for number in range(2):
        paths.append(tmp_path / f"c{number}")
        with CorpusWriter(paths[-1], source="made", configuration={"k": number}, seed=number) as writer:
            for i in range(4):
                writer.add(make_scene(f"s{i}", n_agents=9, n_frames=80, seed=10 * number + i))
            writer.finish()
    assert stylesim("realism", *paths, "--out", tmp_path / "r.csv").code == 2
    assert stylesim("realism", *paths, "--report", tmp_path / "r.csv").code == 2
    said = stylesim("realism", *paths, "--out", tmp_path / "r.json", "--report", tmp_path / "r.html")
    assert said.code == 0 and "real against real" in said.out
    assert json.loads((tmp_path / "r.json").read_text())["format"] == "stylesim-realism"
