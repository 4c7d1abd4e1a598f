import zlib
from collections import Counter, defaultdict
from dataclasses import replace

import numpy as np
import pytest

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.labels import LabelFlag, StyleLabels
from stylesim.merging.balance import MAX_WEIGHT, balance, balance_weights, equal_shares
from stylesim.merging.merge import merge
from tests.conftest import make_scene

CLASSES = ("wild", "calm")


def corpus(out, *, source, units, scenes_per_unit=1, prefix="s", dt_s=0.1, drivers=True) -> Corpus:
    seed = zlib.crc32(source.encode()) % 100_000  # no two sources show the same driving
    with CorpusWriter(out, source=source, configuration={"prefix": prefix}) as writer:
        for u in range(units):
            for k in range(scenes_per_unit):
                scene = make_scene(f"{prefix}{u}-{k}", seed=seed + 10 * u + k, unit_id=f"{prefix}{u}", source=source)
                # One of five agents is still there two scenes later, across a guard gap.
                names = tuple(f"car-{i + 2 * k}" for i in range(5))
                driver = scene.tracks.driver if drivers else ()
                tracks = replace(scene.tracks, dt_s=dt_s, agent_id=names, driver=driver)
                writer.add(replace(scene, tracks=tracks, start_s=13.0 * k))
        return writer.finish()


def label(target: Corpus, *, scaler="one", highway=lambda row: False) -> None:
    """The first car of each scene is wild, the third is nobody knows what, the others are calm."""
    rows = [(scene.scene_id, agent) for scene in target for agent in scene.tracks.agent_id]
    style = [{0: 0, 2: -1}.get(i, 1) for scene in target for i in range(scene.tracks.n_agents)]
    n = len(rows)
    target.write_labels(
        [
            StyleLabels(
                method="tdbm", span="track", classes=CLASSES, feature_names=("v",), scene_id=tuple(r[0] for r in rows),
                agent_id=tuple(r[1] for r in rows), start_frame=np.zeros(n, np.int32), stop_frame=np.full(n, 130),
                score=np.zeros((n, 2)), style=np.array(style), margin=np.zeros(n), aggressiveness=np.zeros(n),
                feature=np.arange(n)[:, None] * 1.0, missing=np.zeros((n, 1), bool),
                flags=np.array([int(LabelFlag.HIGHWAY) * highway(row) for row in range(n)], np.int32),
                provenance={"scaler": scaler},
            )
        ]
    )  # fmt: skip


@pytest.fixture
def two(tmp_path):
    return [
        corpus(tmp_path / "sim", source="sumo", units=10),
        corpus(tmp_path / "real", source="dlr_ut", units=1, scenes_per_unit=12, drivers=False),
    ]


def test_equal_inputs_give_equal_bytes(tmp_path, two):
    one = merge(two, seed=3, out=tmp_path / "one", balance="source", noise="fit")
    assert one.fingerprint == merge(two, seed=3, out=tmp_path / "two", balance="source", noise="fit").fingerprint
    assert one.fingerprint != merge(two, seed=4, out=tmp_path / "three", balance="source", noise="fit").fingerprint


def test_nothing_leaks(tmp_path, two):
    merged = merge(two, seed=3, out=tmp_path / "out")
    units, agents, spans = defaultdict(set), defaultdict(set), []
    for info, scene in zip(merged.info, merged, strict=True):
        units[info.source, info.unit_id].add(info.split)
        if info.source == "dlr_ut":
            spans.append((info.start_s, info.start_s + 13.0, info.split))
            for agent in scene.tracks.agent_id:
                agents[agent].add(info.split)
    assert all(len(sides) == 1 for (source, _), sides in units.items() if source == "sumo")
    assert units["dlr_ut", "s0"] == {"train", "val", "test"}
    assert all(len(sides) == 1 for sides in agents.values())
    for one in spans:
        assert all(other[0] - one[1] >= 11.0 for other in spans if other[0] > one[0] and other[2] != one[2])


def test_no_step_is_lost_unsaid(tmp_path, two):
    merged = merge(two, seed=3, out=tmp_path / "out")
    counts = merged.manifest["counts"]
    assert counts["steps_in"] == sum(i.n_steps for c in two for i in c.info)
    left_out = ("near_duplicates", "parted_by_official_splits", "guard_gaps")
    gone = sum(counts[f"steps_{'' if name.startswith('parted') else 'in_'}{name}"] for name in left_out)
    assert counts["steps_in"] == merged.manifest["n_steps"] + gone + counts["steps_taken_out"]
    assert counts["scenes_in_guard_gaps"] == 2
    assert counts["tracks_taken_out_of_a_second_block"] > 0
    assert merged.manifest["configuration"]["split_rule"]["dlr_ut"].startswith("within-recording")


def test_a_scene_whose_agents_all_belong_elsewhere_is_dropped(tmp_path):
    with CorpusWriter(tmp_path / "in", source="dlr_ut", configuration={}) as writer:
        for k in range(12):  # the same five cars throughout
            writer.add(replace(make_scene(f"s{k}", seed=k, unit_id="u", source="dlr_ut"), start_s=13.0 * k))
        source = writer.finish()
    merged = merge([source], seed=1, out=tmp_path / "out")
    assert {info.split for info in merged.info} == {"train"}
    assert merged.manifest["counts"]["scenes_without_an_agent_left"] == 2


def test_clashing_ids_are_told_apart(tmp_path, two):
    merged = merge(two, seed=3, out=tmp_path / "out")
    ids = [info.scene_id for info in merged.info]
    assert len(set(ids)) == len(ids)
    assert {"c0-s0-0", "c1-s0-0", "s5-0"} <= set(ids)
    np.testing.assert_array_equal(merged.scene("c0-s0-0").tracks.position_m, two[0].scene("s0-0").tracks.position_m)


def test_labels_of_one_labeller_are_carried_and_balanced(tmp_path, two):
    for source in two:
        label(source)
    merged = merge(two, seed=3, out=tmp_path / "out", balance="tdbm")
    labels = merged.labels("tdbm", "track")
    have = {(scene.scene_id, agent) for scene in merged for agent in scene.tracks.agent_id}
    assert set(zip(labels.scene_id, labels.agent_id, strict=True)) == have
    split = {info.scene_id: info.split for info in merged.info}
    share: Counter[str] = Counter()
    weights = merged.weights()
    for row in range(len(labels)):
        key = (labels.scene_id[row], labels.agent_id[row])
        assert (key in weights) == (split[key[0]] == "train")
        if key in weights:
            share[labels.class_name(row)] += weights[key]
            assert weights[key] == 1.0 or labels.class_name(row) != "undetermined"
    assert share["wild"] == pytest.approx(share["calm"])
    assert weights == pytest.approx(balance_weights(merged, "tdbm"))


@pytest.mark.parametrize("by", ["context", "tdbm+context"])
def test_contexts_get_equal_shares(tmp_path, two, by):
    """Every third driver is on a highway: after balancing, contexts (in every class) weigh the same."""
    for source in two:
        label(source, highway=lambda row: row % 3 == 0)
    merged = merge(two, seed=3, out=tmp_path / "out", balance=by)
    labels, weights = merged.labels("tdbm", "track"), merged.weights()
    share: Counter[tuple[str, bool]] = Counter()
    for row in range(len(labels)):
        key = (labels.scene_id[row], labels.agent_id[row])
        style = "any" if by == "context" else labels.class_name(row)
        share[style, bool(labels.flags[row] & int(LabelFlag.HIGHWAY))] += weights.get(key, 0.0)
        assert by == "context" or style != "undetermined" or weights.get(key, 1.0) == 1.0
    determined = {key: total for key, total in share.items() if key[0] != "undetermined"}
    assert len(determined) == (2 if by == "context" else 4)
    assert list(determined.values()) == pytest.approx([next(iter(determined.values()))] * len(determined))
    assert weights == pytest.approx(balance_weights(merged, by))


def test_labels_of_other_labellers_are_left_behind_and_said(tmp_path, two):
    label(two[0], scaler="one")
    label(two[1], scaler="other")
    merged = merge(two, seed=3, out=tmp_path / "out")
    assert not merged.has_labels("tdbm", "track")
    assert "different scalers" in merged.manifest["configuration"]["labels_left_behind"][0]
    with pytest.raises(InputError, match="same labeller"):
        merge(two, seed=3, out=tmp_path / "no", balance="tdbm")


def test_missing_labels_name_the_command(tmp_path, two):
    label(two[0])
    with pytest.raises(InputError, match=r"stylesim label .*real --method tdbm"):
        merge(two, seed=3, out=tmp_path / "out", balance="tdbm")
    assert not (tmp_path / "out").exists()


def test_noise_makes_labels_void_and_balancing_comes_after(tmp_path, two):
    for source in two:
        label(source)
    with pytest.raises(InputError, match="noise makes the labels"):
        merge(two, seed=3, out=tmp_path / "no", balance="tdbm", noise="fit")
    merged = merge(two, seed=3, out=tmp_path / "out", noise="fit")
    assert not merged.has_labels("tdbm", "track")
    assert merged.manifest["configuration"]["noise"][0]["source"] == "dlr_ut"
    with pytest.raises(InputError, match="stylesim label"):
        balance(merged, "tdbm")
    label(merged)
    written = balance(merged, "tdbm")
    assert Corpus(merged.path).weights() == written
    assert Corpus(merged.path).fingerprint == merged.fingerprint


def test_noise_is_for_simulated_tracks_only(tmp_path, two):
    merged = merge(two, seed=3, out=tmp_path / "out", noise="fit")
    real = merged.scene("c1-s0-0").tracks
    source = two[1].scene("s0-0").tracks
    keep = np.isin(source.agent_id, real.agent_id)
    np.testing.assert_array_equal(real.position_m, source.position_m[keep])
    simulated = merged.scene("s5-0").tracks
    assert not np.array_equal(simulated.position_m, two[0].scene("s5-0").tracks.position_m, equal_nan=True)
    assert simulated.driver[0] is not None
    with pytest.raises(InputError, match="only be fitted on recorded"):
        merge(two[:1], seed=3, out=tmp_path / "no", noise="fit")


def test_one_clock(tmp_path, two):
    slow = corpus(tmp_path / "slow", source="other", units=4, prefix="w", dt_s=0.25)
    merged = merge([two[0], slow], seed=3, out=tmp_path / "out")
    assert {info.dt_s for info in merged.info} == {0.1}


def test_weights_are_capped_and_average_one():
    groups = {i: "rare" if i == 0 else "common" for i in range(100)}
    weights = equal_shares(groups)
    assert weights[0] == MAX_WEIGHT
    even = equal_shares({0: "a", 1: "b", 2: "b", 3: "undetermined"})
    assert even == {0: 1.5, 1: 0.75, 2: 0.75, 3: 1.0}


def test_bad_requests(tmp_path, two):
    for options, says in (
        ({"balance": "tdmb"}, "Did you mean 'tdbm'"),
        ({"noise": "fitt"}, "Did you mean 'fit'"),
        ({"split": (0.5, 0.5, 0.5)}, "sum to 1"),
    ):
        with pytest.raises(InputError, match=says):
            merge(two, seed=3, out=tmp_path / "out", **options)
    with pytest.raises(InputError, match="no corpus"):
        merge([], seed=3, out=tmp_path / "out")
    with pytest.raises(InputError, match="name it once"):
        merge([two[0], Corpus(two[0].path)], seed=3, out=tmp_path / "out")


def test_an_interrupted_merge_resumes_to_the_same_bytes(tmp_path, two):
    def stop(done, _):
        if done == 15:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        merge(two, seed=3, out=tmp_path / "out", progress=stop)
    assert not (tmp_path / "out").exists()
    again = merge(two, seed=3, out=tmp_path / "out", resume=True)
    assert again.fingerprint == merge(two, seed=3, out=tmp_path / "straight").fingerprint
