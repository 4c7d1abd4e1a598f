"""What the verbs tell beside their tables."""

from __future__ import annotations


def test_list_without_a_word_lists_everything(stylesim):
    said = stylesim("list")
    assert said.code == 0
    for word in ("yellow_light", "rare_heavy", "threatening", "nuscenes"):
        assert word in said.out


def test_label_says_whose_scale_judged_and_who_was_left_out(stylesim, corpus):
    said = stylesim("label", corpus)
    assert said.code == 0
    assert "judged by the scale of sim-reference; " in said.out
    labelled = int(said.out.split("tdbm: ")[1].split()[0])
    left, total = said.out.split("sim-reference; ")[1].split(" tracks")[0].split(" of ")
    assert int(left) + labelled == int(total) == 24
