from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.labelers.history import history_labels
from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.labelling import label
from stylesim.labelers.reference import default_labeler, fit_reference, load_labeler, new_labeler
from stylesim.labelers.tdbm import TDBM
from stylesim.windows import WindowSpec, anchor_frames, target_agents

from .made import scene_of, straight, traffic


def corpus_of(path: Path, *scenes: object) -> Corpus:
    with CorpusWriter(path, source="made", configuration={}) as writer:
        for scene in scenes:
            writer.add(scene)  # type: ignore[arg-type]
        return writer.finish()


@pytest.fixture
def corpus(tmp_path: Path) -> Corpus:
    return corpus_of(tmp_path / "corpus", traffic("a", seed=1), traffic("b", seed=2))


@pytest.mark.parametrize("method", [TDBM, KDSC])
def test_stored_history_labels_are_what_a_forecaster_computes(corpus: Corpus, method: type[TDBM] | type[KDSC]) -> None:
    labeler = method().fit(corpus)
    calls: list[tuple[int, int]] = []
    tracks = label(corpus, labeler, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(1, 2), (2, 2)]
    assert tracks.span == "track"
    assert len(tracks) == 80
    stored = corpus.labels(labeler.method, "history")
    spec = WindowSpec()
    row = 0
    for scene in corpus:
        steps = spec.steps(scene.tracks.dt_s)[0]
        for t0 in anchor_frames(scene, spec):
            agents = target_agents(scene, t0, spec)
            fresh = history_labels(labeler, scene.history(t0, steps), agents)
            here = slice(row, row + len(agents))
            for name in ("score", "style", "margin", "aggressiveness", "feature", "missing", "flags"):
                np.testing.assert_array_equal(getattr(stored, name)[here], getattr(fresh, name))
            assert stored.agent_id[here] == fresh.agent_id
            assert set(stored.stop_frame[here]) == {t0 + 1}
            row += len(agents)
    assert row == len(stored) > 100


def test_a_corpus_too_short_for_histories_has_an_empty_file_of_them(corpus: Corpus, tmp_path: Path) -> None:
    short = corpus_of(tmp_path / "short", scene_of([straight(0, 10, frames=60)], name="s"))
    label(short, TDBM().fit(corpus))
    assert len(short.labels("tdbm", "history")) == 0
    assert len(short.labels("tdbm", "track")) == 1


def test_a_labeller_that_was_not_fitted_says_so(corpus: Corpus) -> None:
    for method in (TDBM, KDSC):
        with pytest.raises(InputError, match="call fit"):
            label(corpus, method())
    assert not corpus.has_labels("tdbm", "track")


def test_a_reference_is_written_and_read_back(corpus: Corpus, tmp_path: Path) -> None:
    paths = fit_reference(corpus, "test-reference", out=tmp_path / "scalers")
    assert [p.name for p in paths] == ["test-reference.tdbm.json", "test-reference.kdsc.json"]
    scene = traffic("c", seed=3)
    for path, method in zip(paths, ("tdbm", "kdsc"), strict=True):
        loaded = load_labeler(path)
        fresh = new_labeler(method, history_s=(1.1, 2.0, 5.0)).fit(corpus)
        assert loaded.hash_ == fresh.hash_
        assert loaded.provenance_["corpus_fingerprint"] == corpus.fingerprint
        np.testing.assert_array_equal(loaded.label_windows(scene).score, fresh.label_windows(scene).score)


def test_unknown_references_and_damaged_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="tdbm"):
        default_labeler("tbdm")
    with pytest.raises(InputError, match="reference"):
        default_labeler("tdbm", reference="no such one")
    bad = tmp_path / "bad.json"
    with pytest.raises(InputError, match="no such file"):
        load_labeler(bad)
    for text in ("{", "[]", '{"labeler": "else"}', '{"labeler": "tdbm", "schema": 99}'):
        bad.write_text(text)
        with pytest.raises(InputError):
            load_labeler(bad)
