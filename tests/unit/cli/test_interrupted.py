"""A verb that is stopped by the user, by a full disk, or by a kill: what is left, what is said, what goes on."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from stylesim.corpus import Corpus
from tests.unit.cli.conftest import write_corpus


def interrupt(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("words", "target", "hint"),
    [
        (["merge", "corpus", "--out", "new"], "stylesim.merging.merge.planned_scenes", "--resume"),
        (["label", "corpus"], "stylesim.labelers.labelling.target_agents", "to start anew"),
        (["train", "corpus", "--out", "new"], "stylesim.forecasting.loop.Loop.run", "--resume"),
        (["evaluate", "constant_velocity", "corpus", "--by", "scenario", "--out", "new"],
         "stylesim.report.evaluate.build_report", "to start anew"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)  # fmt: skip
def test_ctrl_c_says_how_to_go_on(words, target, hint, stylesim, corpus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STYLESIM_CACHE", str(tmp_path / "cache"))
    with monkeypatch.context() as patched:
        patched.setattr(target, interrupt)
        said = stylesim(*words)
    assert said.code == 130
    assert "interrupted" in said.err
    assert hint in said.err
    assert not (tmp_path / "new").exists()
    assert not list((corpus / "labels").glob("*"))


def test_a_merge_goes_on_where_it_was_stopped(stylesim, corpus, tmp_path, monkeypatch):
    from stylesim.merging import plan

    write_corpus(tmp_path / "many", 70, splits=False)
    seen = 0
    original = plan.on_common_clock

    def stop_late(*args, **kwargs):
        nonlocal seen
        seen += 1
        return original(*args, **kwargs) if seen < 40 else interrupt()

    with monkeypatch.context() as patched:
        patched.setattr(plan, "on_common_clock", stop_late)
        assert stylesim("merge", tmp_path / "many", "--out", tmp_path / "new").code == 130
    assert not (tmp_path / "new").exists()
    said = stylesim("merge", tmp_path / "many", "--out", tmp_path / "new")
    assert (said.code, "add --resume" in said.err) == (2, True)
    said = stylesim("merge", tmp_path / "many", "--out", tmp_path / "new", "--seed", "5", "--resume")
    assert (said.code, "other settings" in said.err) == (2, True)
    assert stylesim("merge", tmp_path / "many", "--out", tmp_path / "new", "--resume").code == 0
    assert stylesim("merge", tmp_path / "many", "--out", tmp_path / "straight").code == 0
    assert Corpus(tmp_path / "new").fingerprint == Corpus(tmp_path / "straight").fingerprint


@pytest.mark.parametrize("verb", ["merge", "label", "train", "evaluate"])
def test_a_full_disk(verb, stylesim, corpus, tmp_path, monkeypatch):
    words = {
        "merge": ["merge", corpus, "--out", tmp_path / "new"],
        "label": ["label", corpus],
        "train": ["train", corpus, "--out", tmp_path / "new"],
        "evaluate": ["evaluate", "constant_velocity", corpus, "--by", "scenario", "--out", tmp_path / "new"],
    }[verb]

    def full(self, *_):
        raise OSError(errno.ENOSPC, "No space left on device", str(self))

    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_bytes", full)
        said = stylesim(*words)
    assert said.code == 3
    assert "the disk is full" in said.err
    assert not (tmp_path / "new").exists()
    assert not list((corpus / "labels").glob("*.json"))


def test_what_a_killed_evaluation_left_is_in_nobodys_way(stylesim, corpus, tmp_path):
    left = tmp_path / "new.partial"
    left.mkdir()
    (left / "old-model.json").write_text("{}")
    said = stylesim("evaluate", "constant_velocity", corpus, "--by", "scenario", "--out", tmp_path / "new")
    assert said.code == 0, said.err
    assert not left.exists()
    assert not (tmp_path / "new" / "old-model.json").exists()
    assert (tmp_path / "new" / "report.html").is_file()


def test_epochs_of_an_unfinished_training_are_not_thrown_away(stylesim, corpus, tmp_path):
    left = tmp_path / "new.partial"
    left.mkdir()
    (left / "state.pt").write_bytes(b"epochs")
    for verb in (["train", corpus], ["evaluate", "constant_velocity", corpus, "--by", "scenario"]):
        (left / "training.json").write_text("{}")
        said = stylesim(*verb, "--out", tmp_path / "new")
        assert (said.code, "is left from an unfinished run" in said.err) == (2, True)
    assert (left / "state.pt").read_bytes() == b"epochs"
