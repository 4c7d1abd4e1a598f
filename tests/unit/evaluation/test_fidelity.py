"""Fidelity of small written corpora: who is judged, who is not and why, and what may not judge."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.evaluation.commanded import CUT, LEFT, LOST, commanded_drivers
from stylesim.evaluation.fidelity import fidelity
from stylesim.evaluation.fidelity_ranges import needed_ranges
from stylesim.evaluation.fidelity_results import EVERYONE
from stylesim.evaluation.fidelity_robustness import DEFAULT, NO_WANDER
from stylesim.evaluation.scaler_guard import check_unseen
from stylesim.labelers.features import FEATURES
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.reference import default_labeler
from stylesim.labelers.rows import track_rows
from stylesim.labelers.tdbm_matrix import scores
from stylesim.scene import Scene
from stylesim.style import STYLE_CLASSES
from stylesim.tracks import TrackFlag
from tests.conftest import make_scene

FRAMES = 260


def trimmed(scene: Scene, spans: dict[int, tuple[int, int]], flags: dict[int, TrackFlag] | None = None) -> Scene:
    """The scene with some agents seen in [start, stop) only."""
    tracks = scene.tracks
    valid = tracks.valid.copy()
    valid[-1] = True  # make_scene's last car comes late and leaves early
    for agent, (start, stop) in spans.items():
        valid[agent] = False
        valid[agent, start:stop] = True
    valid &= tracks.valid | ~np.isin(np.arange(tracks.n_agents), [tracks.n_agents - 1])[:, None]
    bits = np.zeros(tracks.n_agents, np.int32)
    for agent, flag in (flags or {}).items():
        bits[agent] = int(flag)
    hidden = ~valid
    return replace(
        scene,
        counts={"drivers": tracks.n_agents + 2},
        tracks=replace(
            tracks,
            valid=valid,
            position_m=np.where(hidden[..., None], np.nan, tracks.position_m),
            velocity_mps=np.where(hidden[..., None], np.nan, tracks.velocity_mps),
            heading_rad=np.where(hidden, np.nan, tracks.heading_rad),
            flags=bits,
        ),
    )


def write(out: Path, scenes: list[Scene], seed: int = 5) -> Corpus:
    with CorpusWriter(out, source="made", configuration={}, seed=seed) as writer:
        for one in scenes:
            writer.add(one)
        return writer.finish()


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    scenes = [make_scene(f"s{i}", n_agents=9, n_frames=FRAMES, seed=i, source="sumo") for i in range(6)]
    return write(tmp_path_factory.mktemp("fidelity") / "sim", scenes)


def test_who_is_judged_and_why_not(tmp_path):
    scene = make_scene("s", n_agents=6, n_frames=FRAMES, source="sumo")
    spans = {0: (0, 199), 1: (0, 200), 2: (30, 100), 3: (40, 150)}
    made = trimmed(scene, spans, {3: TrackFlag.REMOVED, 4: TrackFlag.COLLIDED})
    found = commanded_drivers(write(tmp_path / "c", [made]), FeatureOptions())
    assert found.reason == (CUT, "", LEFT, LOST, "", found.reason[5])
    assert found.tracks.agent_id[:2] == ("car-1", "car-4")
    assert found.unseen == 2
    assert sum(found.outcomes.values()) == 1


def test_whole_trips_are_the_labellers_own_rows_and_windows_average_to_them(corpus):
    found = commanded_drivers(corpus, FeatureOptions())
    scene = corpus.scene("s0")
    rows = track_rows(scene, FeatureOptions())
    place = [
        rows.agent_id.index(name)
        for name, s in zip(found.tracks.agent_id, found.tracks.scene_id, strict=True)
        if s == "s0"
    ]
    assert np.array_equal(found.tracks.value[: len(place)], rows.value[place], equal_nan=True)
    v_avg = FEATURES.index("v_avg")
    for driver in range(len(place)):
        own = found.windows.value[found.owner == driver, v_avg]
        assert len(own) == 2  # 26 s hold two windows of 11 s
        assert own.mean() == pytest.approx(found.tracks.value[driver, v_avg])


def test_everything_is_reported_and_adds_up(corpus):
    found = fidelity(corpus, draws=50)
    assert {(a.method, a.span) for a in found.agreements if a.reference == "sim-reference"} == {
        (m, s) for m in ("tdbm", "tdbm_transposed", "kdsc") for s in ("track", "window")
    }
    everyone = found.of()[0]
    assert everyone.group == EVERYONE
    left = sum(n for reasons in found.excluded.values() for n in reasons.values())
    assert everyone.n_drivers + left == sum(found.departed.values()) == 54
    names = [v.name for v in found.variants]
    assert names[:2] == [DEFAULT, NO_WANDER] and len(names) == 12
    assert found.variants[0].agreement.count.tolist() == everyone.count.tolist()
    json.dumps(found.to_dict(), allow_nan=False)


def test_the_commanded_class_of_labels_matches_the_label_summary(corpus):
    """The same confusion as `stylesim label` and the report print, from other code."""
    labels = [default_labeler("tdbm").label_windows(scene) for scene in corpus]
    count = np.zeros((6, 6))
    for scene, one in zip(corpus, labels, strict=True):
        by_agent = dict(zip(one.agent_id, one.style.tolist(), strict=True))
        for agent, driver in enumerate(scene.tracks.driver):
            seconds = scene.tracks.valid[agent].sum() * 0.1
            style = by_agent.get(scene.tracks.agent_id[agent], -1)
            if driver is not None and seconds >= 20 and style >= 0:
                count[STYLE_CLASSES.index(driver.name), style] += 1
    assert fidelity(corpus, with_robustness=False, draws=10).of()[0].count.tolist() == count.tolist()


def test_a_corpus_of_a_scalers_seed_or_of_its_very_bytes_is_refused(tmp_path, corpus):
    seed = default_labeler("tdbm").provenance_["corpus_seed"]
    calibration = write(tmp_path / "c", list(corpus), seed=seed)
    with pytest.raises(InputError, match=r"has seed .* fitted on"):
        fidelity(calibration)
    for provenance in (
        {"corpus_fingerprint": corpus.fingerprint},
        {"parts": [{"corpus_sha256": [corpus.fingerprint]}]},
    ):
        with pytest.raises(InputError, match="is in the provenance"):
            check_unseen(corpus, provenance, what="a scaler")
    check_unseen(corpus, {"corpus_fingerprint": "", "corpus_seed": 4}, what="a scaler")


def test_a_corpus_of_a_seed_of_the_calibration_is_refused(tmp_path, corpus, monkeypatch):
    import stylesim.evaluation.scaler_guard as guard

    class Made:
        provenance = {"seeds": {"rounds": [3, 9], "checks": [2]}}  # noqa: RUF012

    monkeypatch.setattr(guard, "calibration_file", lambda backend: Path(f"styles.{backend}.yaml"))
    monkeypatch.setattr(guard, "load_calibration", lambda path: Made)
    with pytest.raises(InputError, match=r"seed 5, one of those that styles\.sumo\.yaml was calibrated with"):
        fidelity(corpus)
    guard.check_not_calibrated_on(write(tmp_path / "other", [corpus.scene("s0")], seed=2))


def test_recordings_and_unknown_scenarios_are_refused(tmp_path, corpus):
    scene = make_scene("s", n_agents=3, n_frames=FRAMES)
    recorded = write(tmp_path / "r", [replace(scene, tracks=replace(scene.tracks, driver=()))])
    with pytest.raises(InputError, match="no driver with a commanded style"):
        fidelity(recorded)
    with pytest.raises(InputError, match="'nowhere'; it has straight"):
        fidelity(corpus, scenarios=("nowhere",))


def test_what_a_class_needs_is_where_it_wins():
    needs = needed_ranges()
    assert needs.shape == (6, 5, 2) and (needs[..., 0] < needs[..., 1]).all()
    middle = needs.mean(axis=2)
    # Aggressive needs a high v_nei and jerk, timid a centred lane: read off the matrix.
    assert middle[0, 1] > 0.6 and middle[0, 4] > 0.6 and middle[5, 0] < 0.3
    assert (scores(middle).argmax(axis=1) == np.arange(6)).sum() >= 5
    assert np.isnan(needed_ranges("transposed")[0]).all()  # aggressive wins nowhere (REFERENCE section 1)


def test_without_wander_only_lane_keeping_changes(corpus):
    from stylesim.evaluation.fidelity_robustness import middle_of_lane

    judge = default_labeler("tdbm")
    people = commanded_drivers(corpus, judge.options)
    still = middle_of_lane(judge.track_scaler_, people)
    others = [i for i, name in enumerate(FEATURES) if name != "s_center"]
    assert np.array_equal(still.tracks.value[:, others], people.tracks.value[:, others], equal_nan=True)
    scaled, _ = judge.track_scaler_.scaled(
        still.tracks.columns(judge.track_scaler_.names), np.zeros(len(people.tracks.agent_id), bool)
    )
    assert scaled[:, 0] == pytest.approx(0.5)
