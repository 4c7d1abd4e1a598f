import numpy as np
import pytest

from stylesim.corpus import Corpus
from stylesim.datasets import read
from stylesim.datasets.study import scenes
from stylesim.errors import InputError
from stylesim.labelers.labelling import label
from stylesim.labelers.mdsi import MDSI
from stylesim.questionnaire import answers_of
from stylesim.tracks import TrackFlag
from tests.formats import study_files as study


def test_participants_keep_their_names_and_carry_their_answers(tmp_path):
    one, two = scenes(study.sample(tmp_path))
    assert (one.unit_id, two.unit_id) == ("study_P1", "study_P2")
    assert one.tracks.agent_id == ("P1", "2", "3", "4", "5", "6", "7")
    assert one.tracks.flagged(TrackFlag.EGO).tolist() == [True] + [False] * 6
    np.testing.assert_array_equal(answers_of(one.parameters, "P1"), study.answers())
    assert np.isnan(answers_of(two.parameters, "P2")).nonzero()[0].tolist() == [3, 8]
    assert one.counts["participants"] == 1


def test_the_whole_way_to_self_reported_styles(tmp_path):
    angry = [6 if i in (3, 12, 19, 28, 43) else 3 for i in range(1, 45)]
    corpus = read("study", study.write(tmp_path / "s", {"P1": angry, "P2": study.answers()}), out=tmp_path / "c")
    found = label(corpus, MDSI().fit(corpus))
    rows = [i for i, who in enumerate(found.agent_id) if who == "P1"]
    assert [found.class_name(i) for i in rows] == ["angry_hostile"]
    others = [i for i, who in enumerate(found.agent_id) if not who.startswith("P")]
    assert {found.class_name(i) for i in others} == {"undetermined"}
    assert Corpus(tmp_path / "c").has_labels("mdsi", "history")


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda f: (f / "answers.csv").unlink(), "cannot read"),
        (lambda f: (f / "drives" / "P3.csv").write_text("id\n"), "'P3' is not among those who answered"),
        (lambda f: study_text(f, "P1,", "P2,"), "two rows of the participant 'P2'"),
        (lambda f: study_text(f, "P1,4,", "P1,9,"), "participant 'P1': the answer to item 1 is 9"),
        (lambda f: study_text(f, "P1,4,", "P1,often,"), "q1 is 'often', no number from 1 to 6"),
        (lambda f: spec_text(f, 'ego: "1"', 'ego: "x"'), "no vehicle 'x'"),
        (lambda f: spec_text(f, "answers.csv", "../answers.csv"), "lies outside of the study's folder"),
        (lambda f: spec_text(f, "drives/*.csv", "../*.csv"), "lie outside of the study's folder"),
        (lambda f: spec_text(f, "drives/*.csv", "none/*.csv"), "no file matches"),
        (lambda f: spec_text(f, "driver: file", "driver: face"), "driver"),
        (lambda f: spec_text(f, "q{item}", "q"), "must contain {item} once"),
        (lambda f: spec_text(f, "answers:", "!!python/object/apply:os.system"), "is not a YAML file"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, spoil, says):
    folder = study.sample(tmp_path / "s")
    spoil(folder)
    with pytest.raises(InputError, match=says):
        list(scenes(folder))


def study_text(folder, old, new):
    path = folder / "answers.csv"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


def spec_text(folder, old, new):
    path = folder / "study.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
