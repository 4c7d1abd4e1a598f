"""What a user gets for a slip: one clear message on stderr, an exit code, and nothing half-written."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from stylesim.resources import agents_dir, scenarios_dir

GENERATE = {
    "scenario": (["highwy"], "Did you mean 'highway'"),
    "scenario with spaces": (["my highway"], "unknown scenario"),
    "folder without scenario.yaml": (["."], "scenario.yaml"),
    "named twice": (["highway", "highway"], "named 2 times"),
    "population": (["highway", "--population", "tdbm_spectum"], "Did you mean 'tdbm_spectrum'"),
    "empty population": (["highway", "--population", ""], "unknown population"),
    "population file": (["highway", "--population", "nope.yaml"], "no such file: nope.yaml"),
    "style": (["highway", "--styles", "agressive=1"], "Did you mean 'aggressive'"),
    "sum": (["highway", "--styles", "aggressive=0.3"], "sum to 0.3, not 1"),
    "negative": (["highway", "--styles", "aggressive=-0.3,timid=1.3"], "is -0.3"),
    "nan": (["highway", "--styles", "aggressive=nan,timid=1"], "is nan"),
    "no share": (["highway", "--styles", ""], "expected STYLE=SHARE"),
    "twice": (["highway", "--styles", "timid=0.5,timid=0.5"], "given twice"),
    "both": (["highway", "--styles", "timid=1", "--population", "neutral"], "cannot go with"),
    "reweight": (["highway", "--reweight", "aggressive=1.3"], "[0, 1]"),
    "episodes": (["highway", "--episodes", "0"], "greater than or equal to 1"),
    "workers": (["highway", "--workers", "0"], "greater than or equal to 1"),
}


@pytest.mark.parametrize("case", GENERATE)
def test_generate_says_what_is_wrong(case, stylesim, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words, message = GENERATE[case]
    said = stylesim("generate", *words, "--out", "new")
    assert said.code == 2
    assert message in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("out", ["", ".", "/"])
def test_out_must_be_a_name(out, stylesim, corpus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words in (
        ["generate", "highway"],
        ["merge", corpus],
        ["train", corpus],
        ["evaluate", "constant_velocity", corpus],
    ):
        said = stylesim(*words, "--out", out)
        assert (said.code, "is no name for a new folder" in said.err) == (2, True)
    assert [path.name for path in tmp_path.iterdir()] == ["corpus"]


def test_out_must_be_new(stylesim, corpus, tmp_path):
    (tmp_path / "there").mkdir()
    for words in (
        ["generate", "highway"],
        ["merge", corpus],
        ["train", corpus],
        ["evaluate", "constant_velocity", corpus],
    ):
        said = stylesim(*words, "--out", tmp_path / "there")
        assert (said.code, "is there already" in said.err) == (2, True)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("duration_s:", "duraton_s:", "did you mean 'duration_s'"),
        ("backend: highway", "backend: carla", "'sumo' or 'highway'"),
        ("options:", "options:\n  lanez: 3", "lanez"),
        ("options:", "options: [", "is not a YAML file"),
        ("options:", "about2: !!python/object/apply:os.getcwd []\noptions:", "is not a YAML file"),
    ],
)
def test_a_slip_in_a_scenario_names_file_and_key(old, new, message, stylesim, tmp_path):
    text = (scenarios_dir() / "highway" / "scenario.yaml").read_text()
    assert old in text
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "scenario.yaml").write_text(text.replace(old, new, 1))
    said = stylesim("generate", tmp_path / "mine", "--out", tmp_path / "new")
    assert said.code == 2
    assert "scenario.yaml" in said.err
    assert message in said.err
    assert not list(tmp_path.glob("new*"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("aggressive:", "agressive:", "Did you mean 'aggressive'"),
        ("shares:", "sharse:", "did you mean 'shares'"),
        ("timid: 0.25", "timid: .nan", "shares.timid"),
        ("timid: 0.25", "timid: 0.5", "sum to 1.25"),
    ],
)
def test_a_slip_in_a_population_names_file_and_key(old, new, message, stylesim, tmp_path):
    text = (agents_dir() / "rare_heavy.yaml").read_text()
    assert old in text
    file = tmp_path / "mine.yaml"
    file.write_text(text.replace(old, new, 1))
    said = stylesim("generate", "highway", "--population", file, "--out", tmp_path / "new")
    assert said.code == 2
    assert "mine.yaml" in said.err
    assert message in said.err


def test_a_network_that_does_not_compile_leaves_nothing(stylesim, tmp_path):
    pytest.importorskip("libsumo")
    mine = tmp_path / "mine"
    shutil.copytree(scenarios_dir() / "yellow_light", mine)
    (mine / "yellow_light.nod.xml").write_text("<nodes></nodes>")
    said = stylesim("generate", mine, "--episodes", "1", "--out", tmp_path / "new")
    assert said.code == 4
    assert "netconvert could not compile" in said.err
    assert "kept" not in said.err  # nothing was finished
    assert not list(tmp_path.glob("new*"))


@pytest.mark.parametrize(
    "words",
    [["verify"], ["label"], ["labels", "--join", "x.csv"], ["merge", "--out", "x"], ["train", "--out", "x"],
     ["render", "--out", "x.png"], ["balance"]],
    ids=lambda words: words[0],
)  # fmt: skip
def test_a_corpus_that_is_none(words, stylesim, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("hello")
    (tmp_path / "empty").mkdir()
    for path in ("nope", "file", "empty"):
        said = stylesim(words[0], path, *words[1:])
        assert (said.code, f"{path} is no corpus" in said.err) == (3, True)
        assert said.err.count("\n") == 1  # the message stands alone
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "file"]


def changed(corpus: Path, **changes: object) -> None:
    file = corpus / "corpus.json"
    file.write_text(json.dumps({k: v for k, v in (json.loads(file.read_text()) | changes).items() if v is not None}))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"schema_version": 99}, "install a newer one"),
        ({"files": None}, "'files' is missing"),
        ({"files": ["a"]}, "no dict"),
        ({"format": "other"}, "no corpus of stylesim"),
        ({"files": {"../../etc/passwd": "0"}}, "leaves the corpus"),
        ({"files": {"/etc/passwd": "0"}}, "leaves the corpus"),
    ],
)
def test_a_corpus_json_that_cannot_be_right(changes, message, stylesim, corpus):
    changed(corpus, **changes)
    said = stylesim("verify", corpus)
    assert said.code == 3
    assert message in said.err


def test_a_truncated_corpus(stylesim, corpus, tmp_path):
    part = next((corpus / "tracks").iterdir())
    part.write_bytes(part.read_bytes()[:500])
    said = stylesim("verify", corpus)
    assert (said.code, "sha256 differs" in said.err) == (1, True)
    for words in (
        ["label", corpus],
        ["merge", corpus, "--out", tmp_path / "new"],
        ["render", corpus, "--out", tmp_path / "a.png"],
    ):
        said = stylesim(*words)
        assert (said.code, f"{part} is damaged" in said.err) == (3, True)
    manifest = corpus / "corpus.json"
    manifest.write_bytes(manifest.read_bytes()[:100])
    assert "corpus.json is damaged" in stylesim("verify", corpus).err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["corpus"]


def test_other_slips(stylesim, corpus, tmp_path):
    out = ["--out", tmp_path / "new"]
    slips = [
        (["label", corpus, "--window", "0"], 2, "positive number of seconds"),
        (["label", corpus, "--future", "inf"], 2, "positive number of seconds"),
        (["label", corpus, "--window", "3.3"], 2, "--fit CORPUS --window 3.3"),
        (["label", corpus, "--method", "guess"], 2, "'tdbm'"),
        (["labels", corpus, "--join", tmp_path / "a.csv"], 2, "run `stylesim label"),
        (["labels", corpus, "--join", tmp_path / "a.csv", "--span", "all"], 2, "'history'"),
        (["merge", corpus, "--split", "0.8,0.2", *out], 2, "three numbers"),
        (["merge", corpus, "--split", "0.8,0.2,0.2", *out], 2, "sum to 1"),
        (["merge", corpus, "--balance", "stile", *out], 2, "unknown balance"),
        (["merge", corpus, "--noise", "fit", *out], 2, "recorded"),
        (["merge", corpus, corpus, *out], 2, "name it once"),
        (["train", corpus, "--size", "huge", *out], 2, "unknown model size"),
        (["train", corpus, "--robust", "group_dor", *out], 2, "Did you mean 'group_dro'"),
        (["train", corpus, "--augment", corpus, *out], 2, "give another one to add"),
        (["evaluate", corpus, *out], 2, "at least one forecaster"),
        (["evaluate", "constant_speed", corpus, *out], 2, "Did you mean"),
        (["evaluate", "constant_velocity", corpus, "--by", "stile", *out], 2, "unknown stratum 'stile'"),
        (["evaluate", "constant_velocity", corpus, "--by", "tdbm", *out], 2, "run `stylesim label"),
        (["evaluate", "constant_velocity", corpus, "--split", "tset", *out], 2, "no split 'tset'"),
        (["render", corpus, "--scene", "scene-99", "--out", tmp_path / "a.png"], 2, "no scene 'scene-99'"),
        (["render", corpus, "--out", tmp_path / "a.gif"], 2, ".png or .svg"),
        (["read", "dlr", corpus, *out], 2, "Did you mean 'dlr_ut'"),
        (["read", "dlr_ut", tmp_path / "none", *out], 2, "does not exist"),
        (["read", "dlr_ut", corpus, "-o", "scene_s=soon", *out], 2, "expected a positive number"),
        (["read", "dlr_ut", corpus, "-o", "scene_s", *out], 2, "KEY=VALUE"),
        (["describe", "hihgway"], 2, "Did you mean 'highway'"),
        (["list", "everything"], 2, "'scenarios'"),
        (["generaet"], 2, "No such command"),
    ]
    for words, code, message in slips:
        said = stylesim(*words)
        assert (said.code, message in said.err) == (code, True), (words, said.err)
    assert [path.name for path in tmp_path.iterdir()] == ["corpus"]


def test_debug_shows_the_traceback(tmp_path, capsys, monkeypatch):
    from stylesim.cli import main

    monkeypatch.setenv("STYLESIM_DEBUG", "")
    with pytest.raises(SystemExit):
        main(["--debug", "verify", str(tmp_path)])
    assert "Traceback" in capsys.readouterr().err


VERBS = ("generate", "read", "merge", "balance", "verify", "label", "labels", "train")
VERBS += ("evaluate", "render", "list", "describe")


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example(verb, stylesim):
    said = stylesim(verb, "--help")
    assert said.code == 0
    assert f"Example: `stylesim {verb}" in said.out


def test_a_refused_training_leaves_nothing_that_blocks_the_next_verb(stylesim, corpus, tmp_path):
    for words, message in (
        (["--history", "500"], "no agent with a whole history"),
        (["--precision", "8-bit"], "precision"),
    ):
        said = stylesim("train", corpus, *words, "--out", tmp_path / "model")
        assert (said.code, message in said.err) == (2, True)
        assert [path.name for path in tmp_path.iterdir()] == ["corpus"]


def test_comparing_what_is_no_evaluation_names_the_file(stylesim, tmp_path):
    (tmp_path / "labels.csv").write_text("scene_id,style\n")
    said = stylesim("compare", tmp_path / "labels.csv", tmp_path / "labels.csv")
    assert (said.code, f"{tmp_path / 'labels.csv'} (or the .parquet" in said.err) == (2, True)
