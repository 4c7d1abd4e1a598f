from __future__ import annotations

import errno
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from stylesim.corpus import Corpus, CorpusWriter, write_part
from stylesim.errors import CorpusError, InputError
from tests.conftest import make_scene


def write(out: Path, n: int = 5, **options) -> Corpus:
    with CorpusWriter(out, source="made", configuration={"n": n}, seed=1, part_scenes=2, **options) as writer:
        for i in range(n):
            writer.add(make_scene(f"scene-{i}", seed=i), split="train" if i < 3 else "test")
        return writer.finish(weights={("scene-0", "car-0"): 2.0}, run={"workers": 1})


def test_what_goes_in_comes_out(tmp_path):
    corpus = write(tmp_path / "c")
    assert len(corpus) == 5
    for i, got in enumerate(corpus):
        want = make_scene(f"scene-{i}", seed=i)
        for name in ("scene_id", "unit_id", "scenario", "start_s", "counts", "parameters"):
            assert getattr(got, name) == getattr(want, name)
        assert got.tracks.agent_id == want.tracks.agent_id
        assert got.tracks.driver == want.tracks.driver
        np.testing.assert_array_equal(got.tracks.valid, want.tracks.valid)
        np.testing.assert_allclose(got.tracks.position_m, want.tracks.position_m, atol=6e-4)
        np.testing.assert_allclose(got.tracks.velocity_mps, want.tracks.velocity_mps, atol=5.1e-3)
        np.testing.assert_allclose(got.tracks.heading_rad, want.tracks.heading_rad, atol=5.1e-4)
        np.testing.assert_array_equal(got.tracks.origin_m, want.tracks.origin_m)
        np.testing.assert_array_equal(got.signals.state, want.signals.state)
        assert got.signals.lane_id == want.signals.lane_id
        np.testing.assert_allclose(got.road.lanes[1].centre_line_m, want.road.lanes[1].centre_line_m, atol=6e-4)
        assert got.road.lanes[1].right_neighbour == "right"


def test_pairs_and_metadata_come_back(tmp_path):
    about = {"twin": {"driver": "car-1", "at_s": 3.5}, "events": [{"kind": "deer"}]}
    with CorpusWriter(tmp_path / "c", source="made", configuration={}) as writer:
        writer.add(make_scene("a"))
        writer.add(replace(make_scene("a-twin"), twin_of="a", replay_of="r", metadata=about))
        corpus = writer.finish()
    assert [(info.twin_of, info.replay_of, info.metadata) for info in corpus.info] == [("", "", {}), ("a", "r", about)]
    twin = corpus.scene("a-twin")
    assert (twin.twin_of, twin.replay_of, twin.metadata) == ("a", "r", about)
    assert twin.history(20, 10).metadata == {}


def test_a_corpus_of_version_1_is_read(tmp_path):
    corpus = write(tmp_path / "c")
    table = pl.read_parquet(corpus.path / "scenes.parquet").drop("twin_of", "replay_of", "metadata")
    table.write_parquet(corpus.path / "scenes.parquet")
    with pytest.raises(CorpusError, match="lacks the column"):
        _ = Corpus(corpus.path).info
    (corpus.path / "corpus.json").write_text(json.dumps({**corpus.manifest, "schema_version": 1}))
    old = Corpus(corpus.path)
    assert [(info.twin_of, info.metadata) for info in old.info] == [("", {})] * 5
    assert old.scene("scene-1").twin_of == ""


def test_roads_are_stored_once(tmp_path):
    corpus = write(tmp_path / "c")
    assert len(list((corpus.path / "roads").iterdir())) == 1


def test_splits_views_and_weights(tmp_path):
    corpus = write(tmp_path / "c")
    assert [s.scene_id for s in corpus.split("test")] == ["scene-3", "scene-4"]
    assert corpus.weights() == {("scene-0", "car-0"): 2.0}
    assert corpus.scene("scene-4").scene_id == "scene-4"
    with pytest.raises(InputError, match="no split 'val'; it has test, train"):
        corpus.split("val")
    with pytest.raises(InputError, match="did you mean 'scene-4'"):
        corpus.scene("scene-44")


def test_same_scenes_same_bytes_and_no_time_in_the_manifest(tmp_path):
    a, b = write(tmp_path / "a"), write(tmp_path / "b")
    assert a.fingerprint == b.fingerprint
    assert str(tmp_path) not in json.dumps(dict(a.manifest))


def test_an_unfinished_corpus_is_named_and_resumed(tmp_path):
    whole = write(tmp_path / "whole")
    out = tmp_path / "c"
    writer = CorpusWriter(out, source="made", configuration={"n": 5}, seed=1, part_scenes=2)
    for i in range(3):  # one part is whole, one is pending: the process dies here
        writer.add(make_scene(f"scene-{i}", seed=i), split="train")
    assert not out.exists()
    with pytest.raises(CorpusError, match="unfinished: repeat its command with --resume"):
        Corpus(out)
    with pytest.raises(InputError, match="add --resume"):
        write(out)
    assert write(out, resume=True).fingerprint == whole.fingerprint
    with pytest.raises(InputError, match="is there already"):
        write(out)


def test_resume_refuses_another_request(tmp_path):
    CorpusWriter(tmp_path / "c", source="made", configuration={"n": 1}, seed=1)
    with pytest.raises(InputError, match="begun with other settings"):
        CorpusWriter(tmp_path / "c", source="made", configuration={"n": 2}, seed=1, resume=True)


def test_a_full_disk_is_said_and_leaves_nothing_half_written(tmp_path, monkeypatch):
    out = tmp_path / "c"
    writer = CorpusWriter(out, source="made", configuration={"n": 5}, seed=1, part_scenes=2)
    real = Path.write_bytes

    def full(self, data):
        if "tracks" in str(self):
            real(self, data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(CorpusError, match="the disk is full"):
        write_part(writer.partial, 0, [make_scene()])
    assert not list(writer.partial.rglob("*.tmp"))
    assert not list(writer.partial.rglob("*.parquet"))
    monkeypatch.undo()
    assert len(write(out, resume=True)) == 5


@pytest.mark.parametrize("damage", ["truncate", "garbage", "remove"])
@pytest.mark.parametrize("name", ["tracks/part-00000.parquet", "scenes.parquet", "agents/part-00000.parquet", "road"])
def test_damage_is_named(tmp_path, damage, name):
    corpus = write(tmp_path / "c")
    path = next((corpus.path / "roads").iterdir()) if name == "road" else corpus.path / name
    content = path.read_bytes()
    if damage == "truncate":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "garbage":
        path.write_bytes(b"nonsense" * 50)
    else:
        path.unlink()
    with pytest.raises(CorpusError, match=path.name):
        list(Corpus(corpus.path))


def test_a_newer_schema_is_refused_by_name(tmp_path):
    corpus = write(tmp_path / "c")
    manifest = json.loads((corpus.path / "corpus.json").read_bytes())
    manifest["schema_version"] = 99
    (corpus.path / "corpus.json").write_text(json.dumps(manifest))
    with pytest.raises(CorpusError, match="schema version 99"):
        Corpus(corpus.path)


def test_duplicate_scene_ids_are_refused(tmp_path):
    writer = CorpusWriter(tmp_path / "c", source="made", configuration={})
    writer.add(make_scene("same"))
    writer.add(make_scene("same"))
    with pytest.raises(CorpusError, match="'same' occurs"):
        writer.finish()


def test_the_scales_are_in_the_schema_of_the_file(tmp_path):
    corpus = write(tmp_path / "c")
    about = pl.read_parquet_metadata(corpus.path / "tracks" / "part-00000.parquet")
    assert {name: float(about[name]) for name in corpus.manifest["scales"]} == corpus.manifest["scales"]


def test_large_scenes_make_smaller_parts(tmp_path, monkeypatch):
    monkeypatch.setattr("stylesim.corpus.writer.PART_STEPS", 1000)
    with CorpusWriter(tmp_path / "c", source="made", configuration={}) as writer:
        for i in range(3):
            writer.add(make_scene(f"scene-{i}"))  # 600-odd agent-frames each
        corpus = writer.finish()
    assert [info.part for info in corpus.info] == [0, 0, 1]
    assert [scene.scene_id for scene in corpus] == ["scene-0", "scene-1", "scene-2"]
