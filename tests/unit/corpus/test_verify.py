from __future__ import annotations

import gzip
import json
from dataclasses import replace

import numpy as np

from stylesim.corpus import CorpusWriter
from stylesim.corpus.verify import verify
from stylesim.tracks import TrackFlag
from tests.conftest import make_scene


def written(out, scene):
    with CorpusWriter(out, source="made", configuration={}) as writer:
        writer.add(scene)
        return writer.finish()


def jumping(flags=0):
    scene = make_scene()
    position = scene.tracks.position_m.copy()
    position[1, 60:] += 80.0
    kept = np.zeros(5, int)
    kept[1] = flags
    return replace(scene, tracks=replace(scene.tracks, position_m=position, flags=kept))


def test_a_sound_corpus_passes(tmp_path):
    result = verify(written(tmp_path / "c", make_scene()).path)
    assert result.ok
    assert result.counts["tracks"] == 5
    assert result.counts["overlapping pairs"] == 0


def test_a_teleport_is_found_and_named(tmp_path):
    result = verify(written(tmp_path / "c", jumping()).path)
    assert result.errors == ("scene-0: agent 'car-1': teleports at frame 60",)


def test_a_track_that_is_flagged_implausible_is_counted_not_refused(tmp_path):
    result = verify(written(tmp_path / "c", jumping(int(TrackFlag.IMPLAUSIBLE))).path)
    assert result.ok
    assert result.counts["tracks flagged implausible"] == 1


def test_sliding_and_disagreeing_velocity_are_found(tmp_path):
    scene = make_scene()
    heading = scene.tracks.heading_rad + np.where(np.arange(5) == 2, np.pi / 2, 0)[:, None]
    velocity = scene.tracks.velocity_mps * np.where(np.arange(5) == 0, 2.0, 1.0)[:, None, None]
    bad = replace(scene, tracks=replace(scene.tracks, heading_rad=heading, velocity_mps=velocity))
    text = "\n".join(verify(written(tmp_path / "c", bad).path).errors)
    assert "'car-2': slides" in text
    assert "'car-0': velocity against displacement" in text


def test_overlaps_are_counted(tmp_path):
    scene = make_scene()
    position = scene.tracks.position_m.copy()
    position[2] = position[0] + 1.0
    velocity = scene.tracks.velocity_mps.copy()
    velocity[2] = velocity[0]
    crash = replace(scene, tracks=replace(scene.tracks, position_m=position, velocity_mps=velocity))
    assert verify(written(tmp_path / "c", crash).path).counts["overlapping pairs"] == 1


def test_changed_missing_and_added_files_are_found(tmp_path):
    path = written(tmp_path / "c", make_scene()).path
    track = path / "tracks" / "part-00000.parquet"
    track.write_bytes(track.read_bytes() + b" ")
    (path / "agents" / "part-00000.parquet").unlink()
    (path / "signals" / "stray").write_text("")
    text = "\n".join(verify(path).errors)
    assert "tracks/part-00000.parquet: sha256 differs" in text
    assert "agents/part-00000.parquet: missing" in text
    assert "signals/stray: not listed" in text


def test_roads_are_held_against_their_names(tmp_path):
    path = written(tmp_path / "c", make_scene()).path
    road = next((path / "roads").iterdir())
    (path / "roads" / "stray").write_text("")
    assert verify(path).errors == ("roads/stray: no scene names it",)
    (path / "roads" / "stray").unlink()
    whole = road.read_bytes()
    other = json.loads(gzip.decompress(whole)) | {"source": "inferred"}
    for damaged, said in (
        (gzip.compress(json.dumps(other).encode()), "not what its name says"),
        (whole[:-9], "damaged"),
    ):
        road.write_bytes(damaged)
        assert said in "".join(verify(path).errors)
    road.unlink()
    assert "missing" in "".join(verify(path).errors)
