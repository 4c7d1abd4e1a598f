"""What the verbs tell beside their tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stylesim.corpus import CorpusWriter
from tests.conftest import make_scene


def test_list_without_a_word_lists_everything(stylesim):
    said = stylesim("list")
    assert said.code == 0
    for word in ("yellow_light", "rare_heavy", "threatening", "nuscenes"):
        assert word in said.out


def test_label_says_whose_scale_judged_and_who_was_left_out(stylesim, tmp_path):
    scene = make_scene("mixed", n_agents=4)
    walker = np.array([1, 6, 1, 1], np.int8)  # a pedestrian among cars
    with CorpusWriter(tmp_path / "corpus", source="made", configuration={}) as writer:
        writer.add(replace(scene, tracks=replace(scene.tracks, kind=walker)))
        writer.finish()
    said = stylesim("label", tmp_path / "corpus")
    assert said.code == 0
    assert "tdbm: 3 tracks" in said.out
    assert "judged by the scale of sim-reference; 1 of 4 tracks are no motor vehicles and have no label" in said.out


def test_label_says_that_all_are_labelled(stylesim, corpus):
    assert "judged by the scale of sim-reference; all 24 tracks are labelled" in stylesim("label", corpus).out
