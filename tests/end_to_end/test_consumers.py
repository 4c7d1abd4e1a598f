"""The packages that exports are for load them, each in an environment of its own, and give back the same numbers.

The environments (1 to 7 GB each) are made in the folder that STYLESIM_CONSUMERS names, and found there again the next
time; without it they go with the session. Interpreter of trajdata's: STYLESIM_PYTHON310, because the TensorFlow that it
reads Waymo's files with has no build for later ones.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.exporting import export
from stylesim.exporting.base import cut, numbered, target_of, windows
from stylesim.geometry import arc_length, project
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.simulation.generate import generate

pytestmark = pytest.mark.slow

PROBES = Path(__file__).parent / "consumers"
START, STOP = 40, 290  # frames of each scene: two windows of av2 and of womd, in which lights change
POSITION_M, VELOCITY_MPS, HEADING_RAD = 1e-4, 1e-4, 1e-5  # float32 of metres and of m/s below 1,000, as exported
LANE_M = 1e-3
# av2 makes its centre lines itself, ten points halfway between the boundaries: measured 0.012 m and 0.16 % of length.
# trajdata cuts the steps between points to whole millimetres, which adds up: measured 0.013 m, 0.08 %.
REMADE_LANE_M, LANE_LENGTH = 0.02, 0.005
PACKAGES: dict[str, Sequence[Sequence[str]]] = {  # arguments of pip, one call each
    "av2": [["av2==0.3.6"]],
    "commonroad": [["commonroad-io==2026.1"]],
    "metadrive": [["metadrive-simulator==0.4.3"]],
    "tactics2d": [["tactics2d==0.1.9"]],
    # Waymo's package pins numpy 1.21 for its metrics; the protos that trajdata wants of it need none of that.
    "trajdata": [["trajdata==1.4.0", "numpy<2", "tensorflow-cpu==2.11.0", "intervaltree"],
                 ["--no-deps", "waymo-open-dataset-tf-2-11-0"]],
}  # fmt: skip


@pytest.fixture(scope="session")
def environments(tmp_path_factory: pytest.TempPathFactory) -> Path:
    named = os.environ.get("STYLESIM_CONSUMERS")
    return Path(named) if named else tmp_path_factory.mktemp("consumers")


@pytest.fixture(scope="session")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    """25 s of SUMO's crossing with lights and of highway-env's motorway."""
    pytest.importorskip("libsumo")
    folder = tmp_path_factory.mktemp("corpus")
    whole = generate(["yellow_light", "highway"], "tdbm_spectrum", episodes=1, seed=11, out=folder / "whole")
    with CorpusWriter(folder / "cut", source="made", configuration={}) as writer:
        for scene in whole:
            writer.add(cut(scene, START, STOP))
        return writer.finish()


def python_of(name: str, environments: Path) -> Path:
    """The interpreter of that consumer's environment, made if it is not there; skips where it cannot be."""
    folder = environments / name
    python = folder / "bin" / "python"
    if (folder / "complete").exists():
        return python
    base = sys.executable
    if name == "trajdata":
        base = os.environ.get("STYLESIM_PYTHON310") or shutil.which("python3.10") or ""
        if not base:
            pytest.skip("trajdata needs a Python 3.10: set STYLESIM_PYTHON310")
    try:
        subprocess.run([base, "-m", "venv", str(folder)], check=True, capture_output=True, text=True)
        for arguments in PACKAGES[name]:
            pip = [str(python), "-m", "pip", "-q", "--disable-pip-version-check", "install", *arguments]
            subprocess.run(pip, check=True, capture_output=True, text=True, timeout=1800)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        why = str(error.stderr)[-300:]
        pytest.skip(f"no environment for {name} could be made (no network?): {error}: {why}")
    (folder / "complete").touch()
    return python


def read_by(name: str, environments: Path, exported: Path) -> dict[str, Any]:
    """What the consumer's probe printed."""
    command = [str(python_of(name, environments)), str(PROBES / f"read_{name}.py"), str(exported)]
    apart = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=apart, timeout=1200)
    assert done.returncode == 0, done.stderr[-3000:]
    read: dict[str, Any] = json.loads(done.stdout)
    assert PACKAGES[name][0][0].endswith(f"=={read['version']}")
    return read


def compare_agents(found: dict[str, Any], scene: Scene, names: dict[str, str], *, least_frames: int = 1) -> int:
    """Every agent with its frames, and at each of them the same numbers; how many agent-frames there were."""
    tracks, compared = scene.tracks, 0
    expected = {names[a] for i, a in enumerate(tracks.agent_id) if tracks.valid[i].sum() >= least_frames}
    assert set(found) == expected
    for i, agent in enumerate(tracks.agent_id):
        if names[agent] not in expected:
            continue
        read, frames = found[names[agent]], np.flatnonzero(tracks.valid[i])
        assert read["frames"] == frames.tolist()
        was = tracks.position_m[i, frames].astype(np.float64) + tracks.origin_m
        np.testing.assert_allclose(read["position"], was, rtol=0, atol=POSITION_M)
        heading, velocity = tracks.heading_rad[i, frames], tracks.velocity_mps[i, frames]
        turned = np.angle(np.exp(1j * (np.array(read["heading"]) - heading)))
        np.testing.assert_allclose(turned, 0, rtol=0, atol=HEADING_RAD)
        if "velocity" in read:
            np.testing.assert_allclose(read["velocity"], velocity, rtol=0, atol=VELOCITY_MPS)
        else:
            along = velocity[:, 0] * np.cos(heading) + velocity[:, 1] * np.sin(heading)
            np.testing.assert_allclose(read["speed"], along, rtol=0, atol=VELOCITY_MPS)
        if "size" in read:
            np.testing.assert_allclose(read["size"], tracks.size_m[i], rtol=0, atol=POSITION_M)
        compared += len(frames)
    assert compared > 0
    return compared


def compare_lanes(found: dict[str, Any], scene: Scene, names: dict[str, str], *, off_m: float = LANE_M) -> None:
    """The same lanes; their ends are the same, and each point read lies on the centre line, of the same length."""
    assert scene.road is not None
    assert set(found) == {names[lane.lane_id] for lane in scene.road.lanes}
    for lane in scene.road.lanes:
        line = np.array(found[names[lane.lane_id]])
        was = lane.centre_line_m.astype(np.float64) + scene.tracks.origin_m
        np.testing.assert_allclose(line[[0, -1]], was[[0, -1]], rtol=0, atol=off_m)
        assert project(line, was)[2].max() < off_m
        assert arc_length(line)[-1] == pytest.approx(arc_length(was)[-1], rel=LANE_LENGTH)


def compare_lights(found: dict[str, Any], scene: Scene, names: dict[str, str], words: dict[SignalState, str]) -> None:
    """At every frame the same colour above the same lanes."""
    assert scene.signals is not None
    lit = {
        names[lane]: row
        for lanes, row in zip(scene.signals.lane_id, scene.signals.state, strict=True)
        for lane in lanes
    }
    assert set(found) == set(lit)
    assert len({state for row in lit.values() for state in row.tolist()}) > 1, "lights that never change prove little"
    for lane, row in lit.items():
        assert found[lane] == [words[SignalState(int(s))] for s in row[: len(found[lane])]]
        assert len(found[lane]) == len(row)


def same(names: Sequence[str]) -> dict[str, str]:
    return {name: name for name in names}


def numbers(names: Sequence[str]) -> dict[str, str]:
    return {name: str(number) for name, number in numbered(tuple(names)).items()}


def lanes_of(scene: Scene) -> list[str]:
    assert scene.road is not None
    return [lane.lane_id for lane in scene.road.lanes]


def test_av2_loads_scenarios_and_maps(tmp_path: Path, corpus: Corpus, environments: Path) -> None:
    counts = export("av2", corpus, out=tmp_path / "out", labels=["commanded"])
    read = read_by("av2", environments, tmp_path / "out")
    compared = 0
    for scene in corpus:
        for window in windows(scene, length=110, t0=49, counts=Counter()):
            found = read["scenes"].pop(f"{scene.scene_id}-{window.number:03d}")
            target = target_of(window)
            assert target is not None
            assert found["focal"] == window.scene.tracks.agent_id[target]
            compared += compare_agents(found["agents"], window.scene, same(window.scene.tracks.agent_id))
            compare_lanes(found["lanes"], scene, numbers(lanes_of(scene)), off_m=REMADE_LANE_M)
    assert not read["scenes"]
    assert compared == counts["agent_frames"]


def test_commonroad_io_loads_scenarios(tmp_path: Path, corpus: Corpus, environments: Path) -> None:
    counts = export("commonroad", corpus, out=tmp_path / "out")
    read = read_by("commonroad", environments, tmp_path / "out")
    listed = [line.split(",") for line in (tmp_path / "out" / "ids.csv").read_text().splitlines()[1:]]
    words = {SignalState.GREEN: "GREEN", SignalState.YELLOW: "YELLOW", SignalState.RED: "RED"}
    compared = 0
    for k, scene in enumerate(corpus, start=1):
        (name,) = [name for name in read["scenes"] if f"-{k}_" in name]
        found = read["scenes"].pop(name)
        of_agent = {agent: number for benchmark, number, agent in listed if benchmark == name}
        names = same(scene.tracks.agent_id) | of_agent  # a single frame makes no obstacle
        compared += compare_agents(found["agents"], scene, names, least_frames=2)
        compare_lanes(found["lanes"], scene, numbers(lanes_of(scene)))
        if scene.signals is not None:
            compare_lights(found["lights"], scene, numbers(lanes_of(scene)), words)
    assert not read["scenes"]
    assert compared == counts["agent_frames"]


def test_metadrive_finds_the_database_sane(tmp_path: Path, corpus: Corpus, environments: Path) -> None:
    counts = export("scenarionet", corpus, out=tmp_path / "out", labels=["commanded"])
    read = read_by("metadrive", environments, tmp_path / "out")
    words = {SignalState.GREEN: "LANE_STATE_GO", SignalState.YELLOW: "LANE_STATE_CAUTION",
             SignalState.RED: "LANE_STATE_STOP"}  # fmt: skip
    compared = 0
    for scene in corpus:
        found = read["scenes"].pop(scene.scene_id)
        assert found["sdc"] in scene.tracks.agent_id
        compared += compare_agents(found["agents"], scene, same(scene.tracks.agent_id))
        compare_lanes(found["lanes"], scene, same(lanes_of(scene)))
        if scene.signals is not None:
            compare_lights(found["lights"], scene, same(lanes_of(scene)), words)
    assert not read["scenes"]
    assert compared == counts["agent_frames"]


def test_tactics2d_loads_recordings(tmp_path: Path, corpus: Corpus, environments: Path) -> None:
    counts = export("levelx", corpus, out=tmp_path / "out", labels=["commanded"])
    read = read_by("tactics2d", environments, tmp_path / "out")
    compared = 0
    for number, scene in enumerate(corpus):
        found, tracks = read["scenes"].pop(str(number))["agents"], scene.tracks
        for agent in found.values():  # the format counts from the recording's origin
            agent["position"] = (np.array(agent["position"]) + tracks.origin_m).tolist()
        seen = tracks.select(tracks.valid.any(axis=1))
        names = {name: str(i) for i, name in enumerate(tracks.agent_id)}
        compared += compare_agents(found, replace(scene, tracks=seen), names)
    assert not read["scenes"]
    assert compared == counts["agent_frames"]


def test_trajdata_loads_waymo_files(tmp_path: Path, corpus: Corpus, environments: Path) -> None:
    counts = export("womd", corpus, out=tmp_path / "out")
    read = read_by("trajdata", environments, tmp_path / "out")
    # it knows green and red, and takes yellow for red
    words = {SignalState.GREEN: "GREEN", SignalState.YELLOW: "RED", SignalState.RED: "RED"}
    compared, once, k = 0, 0, 0
    for scene in corpus:
        for window in windows(scene, length=91, t0=10, counts=Counter()):
            found, tracks = read["scenes"].pop(f"scene_{k}"), window.scene.tracks
            target = target_of(window)
            assert target is not None
            names = numbers(tracks.agent_id) | {tracks.agent_id[target]: "ego"}  # there is none; the one asked about
            compared += compare_agents(found["agents"], window.scene, names, least_frames=2)
            once += int((tracks.valid.sum(axis=1) == 1).sum())  # trajdata drops who is seen once
            compare_lanes(found["lanes"], scene, numbers(lanes_of(scene)), off_m=REMADE_LANE_M)
            if window.scene.signals is not None:
                compare_lights(found["lights"], window.scene, numbers(lanes_of(scene)), words)
            k += 1
    assert not read["scenes"]
    assert compared + once == counts["agent_frames"]
