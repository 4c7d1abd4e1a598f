"""Write and read again: the identity within each format's precision, for every agent, lane and light."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.datasets.reading import read
from stylesim.errors import InputError
from stylesim.exporting import export
from stylesim.exporting.export import EXPORTS, RECORD_FILE
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.signals import Signals, SignalState
from stylesim.tracks import AgentKind, Tracks
from tests.conftest import make_scene

CORPUS_M, CORPUS_MPS, CORPUS_RAD = 0.0011, 0.011, 0.0011  # what a corpus itself rounds to, twice


@dataclass(frozen=True)
class Keeps:
    """What a format keeps of a scene."""

    reader: str
    frames: int  # of a scene of 130; windows are cut
    sizes: bool = True
    velocity: bool = True
    links: bool = True
    limits: bool = True
    lights: bool = True
    road: bool = True
    folder: str = ""


FORMATS = {
    "av2": Keeps("av2", 110, sizes=False, limits=False, lights=False),
    "scenarionet": Keeps("scenarionet", 130),
    "womd": Keeps("womd", 91),
    "gpudrive": Keeps("gpudrive", 91, limits=False),
    "commonroad": Keeps("commonroad", 130, velocity=False),
    "levelx": Keeps("ind", 130, links=False, limits=False, lights=False, road=False),
}


def scene_with_everything(scene_id: str = "made-0", seed: int = 0) -> Scene:
    """Five cars and a bus on lanes with neighbours and successors, a light and a crosswalk; one comes late."""
    scene = make_scene(scene_id, seed=seed, n_agents=6)
    ids = tuple(str(100 + i) for i in range(6))
    kind = np.full(6, AgentKind.CAR)
    kind[1] = AgentKind.BUS
    tracks = replace(scene.tracks, agent_id=ids, kind=kind, origin_m=np.array([1200.0, -340.0]))
    line = np.stack([np.linspace(-50, 300, 36), np.zeros(36)], axis=1)
    on = np.stack([np.linspace(300, 600, 31), np.zeros(31)], axis=1)
    stop = np.array([[300.0, 1.75], [300.0, -1.75]])
    across = np.array([0.0, 3.5])
    lanes = (
        Lane("1", line, width_m=3.5, speed_limit_mps=13.9, successors=("3",), left_neighbour="2", stop_line_m=stop),
        Lane("2", line + across, width_m=3.5, speed_limit_mps=13.9, successors=("4",), right_neighbour="1",
             stop_line_m=stop + across),
        Lane("3", on, width_m=3.5, speed_limit_mps=8.3, in_junction=True, left_neighbour="4"),
        Lane("4", on + across, width_m=3.5, speed_limit_mps=8.3, in_junction=True, right_neighbour="3"),
    )  # fmt: skip
    walk = np.array([[310.0, -3.0], [310.0, 6.0], [313.0, 6.0], [313.0, -3.0]])
    state = np.full((2, 130), SignalState.GREEN)
    state[0, 60:70], state[0, 70:] = SignalState.YELLOW, SignalState.RED
    signals = Signals(("1", "2"), (("1",), ("2",)), state)
    return replace(scene, tracks=tracks, road=Road(lanes, crosswalks_m=(walk,)), signals=signals)


@pytest.fixture
def corpus(tmp_path: Path) -> Corpus:
    with CorpusWriter(tmp_path / "corpus", source="made", configuration={}) as writer:
        writer.add(scene_with_everything())
        return writer.finish()


@pytest.mark.parametrize("name", sorted(EXPORTS))
def test_every_agent_comes_back(tmp_path: Path, corpus: Corpus, name: str) -> None:
    keeps = FORMATS[name]
    counts = export(name, corpus, out=tmp_path / "out")
    assert counts["written"] == 1
    back = next(iter(read(keeps.reader, tmp_path / "out", out=tmp_path / "back")))
    was = corpus.scene("made-0").tracks.frames(0, keeps.frames)
    now = back.tracks
    assert counts["agent_frames"] == int(was.valid.sum())
    assert now.n_frames == keeps.frames
    assert int(now.valid.sum()) == int(was.valid.sum())
    far = np.array([j for i in range(was.n_agents) for j in [_match(was, now, i, name)]])
    assert sorted(far.tolist()) == list(range(was.n_agents))
    there, here = now.position_m[far] - _from(now, name), was.position_m.astype(np.float64)
    np.testing.assert_array_equal(now.valid[far], was.valid)
    np.testing.assert_allclose(there, here, atol=2 * CORPUS_M)
    turned = np.abs(np.angle(np.exp(1j * (now.heading_rad[far] - was.heading_rad))))
    assert np.nanmax(turned) < 2 * CORPUS_RAD
    if keeps.velocity:
        np.testing.assert_allclose(now.velocity_mps[far], was.velocity_mps, atol=2 * CORPUS_MPS)
    if keeps.sizes:
        np.testing.assert_allclose(now.size_m[far], was.size_m, atol=0.01)


def _from(now: Tracks, name: str) -> np.ndarray:
    """Where the scene's own origin lies in the frame of what came back."""
    home = np.zeros(2) if name == "levelx" else np.array([1200.0, -340.0])  # that one is written from the origin
    return home - now.origin_m


def _match(was: Tracks, now: Tracks, i: int, name: str) -> int:
    """The track that is where agent i was in its first frame."""
    t = int(was.valid[i].argmax())
    gap = now.position_m[:, t] - _from(now, name) - was.position_m[i, t]
    return int(np.nanargmin(np.where(now.valid[:, t], np.hypot(gap[:, 0], gap[:, 1]), np.inf)))


@pytest.mark.parametrize("name", sorted(name for name, keeps in FORMATS.items() if keeps.road))
def test_every_lane_and_light_comes_back(tmp_path: Path, corpus: Corpus, name: str) -> None:
    keeps = FORMATS[name]
    export(name, corpus, out=tmp_path / "out")
    back = next(iter(read(keeps.reader, tmp_path / "out", out=tmp_path / "back")))
    was = corpus.scene("made-0")
    assert back.road is not None and was.road is not None
    found = {lane.lane_id: lane for lane in back.road.lanes}
    assert set(found) == {"1", "2", "3", "4"}
    for lane in was.road.lanes:
        other = found[lane.lane_id]
        ends = np.stack([lane.centre_line_m[0], lane.centre_line_m[-1]]) + was.tracks.origin_m
        again = np.stack([other.centre_line_m[0], other.centre_line_m[-1]]) + back.tracks.origin_m
        np.testing.assert_allclose(again, ends, atol=0.02)
        assert other.in_junction == lane.in_junction or not keeps.links or name == "gpudrive"
        assert set(other.successors) == set(lane.successors)
        if name != "gpudrive":
            assert (other.left_neighbour, other.right_neighbour) == (lane.left_neighbour, lane.right_neighbour)
            assert other.width_m == pytest.approx(3.5, abs=0.05)
        if keeps.limits:
            assert other.speed_limit_mps == pytest.approx(lane.speed_limit_mps, abs=0.01)
    if not keeps.lights:
        assert back.signals is None
        return
    assert back.signals is not None and was.signals is not None
    states = dict(zip(back.signals.lane_id, back.signals.state, strict=True))
    for lanes, row in zip(was.signals.lane_id, was.signals.state, strict=True):
        np.testing.assert_array_equal(states[lanes], row[: keeps.frames])


@pytest.mark.parametrize("name", sorted(EXPORTS))
def test_styles_go_along_only_where_they_are_asked_for(tmp_path: Path, corpus: Corpus, name: str) -> None:
    def written(out: Path) -> bytes:
        files = sorted(p for p in out.rglob("*") if p.is_file() and p.name != RECORD_FILE)
        return b"".join(p.read_bytes() for p in files)

    export(name, corpus, out=tmp_path / "plain")
    export(name, corpus, out=tmp_path / "styled", labels=["commanded"])
    assert b"commanded_style" not in written(tmp_path / "plain")
    assert b"commanded_style" in written(tmp_path / "styled")
    record = json.loads((tmp_path / "styled" / RECORD_FILE).read_text())
    assert record["labels"] == ["commanded"]
    assert record["counts"]["written"] == 1


@pytest.mark.parametrize("name", sorted(EXPORTS))
def test_the_same_corpus_gives_the_same_bytes(tmp_path: Path, corpus: Corpus, name: str) -> None:
    for out in ("a", "b"):
        export(name, corpus, out=tmp_path / out, labels=["commanded"])
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert files
    assert all((tmp_path / "a" / p).read_bytes() == (tmp_path / "b" / p).read_bytes() for p in files)


def test_what_cannot_be_written_is_refused_before_anything_is(tmp_path: Path, corpus: Corpus) -> None:
    with pytest.raises(InputError, match="no tdbm labels"):
        export("av2", corpus, out=tmp_path / "out", labels=["tdbm"])
    with pytest.raises(InputError, match="Did you mean 'womd'"):
        export("wmd", corpus, out=tmp_path / "out")
    with CorpusWriter(tmp_path / "short", source="made", configuration={}) as writer:
        writer.add(make_scene("s", n_frames=60))
        short = writer.finish()
    with pytest.raises(InputError, match="scenes_too_short: 1"):
        export("av2", short, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "out.partial").exists()


def test_a_long_scene_becomes_windows_and_the_rest_is_counted(tmp_path: Path) -> None:
    with CorpusWriter(tmp_path / "long", source="made", configuration={}) as writer:
        writer.add(make_scene("s", n_frames=250))
        made = writer.finish()
    counts = export("av2", made, out=tmp_path / "out")
    assert counts["written"] == 2
    assert counts["frames_left_over"] == 30


@pytest.mark.parametrize("name", sorted(EXPORTS))
def test_no_scene_of_a_recording_that_was_cut_is_lost(tmp_path: Path, name: str) -> None:
    with CorpusWriter(tmp_path / "cut", source="made", configuration={}) as writer:
        for number in range(3):
            scene = scene_with_everything(f"recording_{number:05d}", seed=number)
            writer.add(replace(scene, source_scenario_id="recording"))
        made = writer.finish()
    assert export(name, made, out=tmp_path / "out")["written"] == 3
    kept = FORMATS[name]
    back = read(kept.reader, tmp_path / "out" / kept.folder, out=tmp_path / "back")
    assert len(back) == 3


@pytest.mark.parametrize("name", ["av2", "womd", "gpudrive"])
def test_scenarios_of_one_name_in_two_sources_are_both_written(tmp_path: Path, name: str) -> None:
    t0 = {"av2": 49, "womd": 10, "gpudrive": 10}[name]
    with CorpusWriter(tmp_path / "two", source="made", configuration={}) as writer:
        for number in range(2):
            scene = scene_with_everything(f"source{number}_7", seed=number)
            writer.add(replace(scene, source_scenario_id="7", t0_frame=t0))
        made = writer.finish()
    assert export(name, made, out=tmp_path / "out")["written"] == 2
    back = read(FORMATS[name].reader, tmp_path / "out", out=tmp_path / "back")
    assert len(back) == 2


def test_frames_of_kinds_that_gpudrive_does_not_know_are_not_counted_as_written(tmp_path: Path) -> None:
    scene = scene_with_everything()
    kind = scene.tracks.kind.copy()
    kind[2] = AgentKind.OTHER
    with CorpusWriter(tmp_path / "kinds", source="made", configuration={}) as writer:
        writer.add(replace(scene, tracks=replace(scene.tracks, kind=kind)))
        made = writer.finish()
    counts = export("gpudrive", made, out=tmp_path / "out")
    assert counts["agents_of_unknown_kinds"] == 1
    back = read("gpudrive", tmp_path / "out", out=tmp_path / "back")
    assert counts["agent_frames"] == back.manifest["n_steps"]
