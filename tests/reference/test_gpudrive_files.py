"""GPUDrive JSON that we write against files of its own data set: the same fields of the same types, and our numbers.

GPUDrive itself needs a C++ and CUDA build, so it is its published files that say what it reads.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stylesim.corpus import CorpusWriter
from stylesim.exporting import export
from stylesim.signals import Signals, SignalState
from tests.conftest import make_scene

FRAMES = 91


def shape_of(value: Any) -> Any:
    """The types of a document; of a list those of all its entries together."""
    if isinstance(value, dict):
        return {key: shape_of(item) for key, item in value.items()}
    if isinstance(value, list):
        return [merged([shape_of(item) for item in value])]
    return "number" if isinstance(value, int | float) and not isinstance(value, bool) else type(value).__name__


def merged(shapes: list[Any]) -> Any:
    if not shapes:
        return None
    if all(isinstance(shape, dict) for shape in shapes):
        keys = {key for shape in shapes for key in shape}
        return {key: merged([shape[key] for shape in shapes if key in shape]) for key in keys}
    if all(isinstance(shape, list) for shape in shapes):
        return [merged([item for shape in shapes for item in shape if item is not None])]
    return shapes[0]


def missing(theirs: Any, ours: Any, at: str = "") -> list[str]:
    """What theirs has and ours has not, or of another type; lists that are empty on either side say nothing."""
    if theirs is None or ours is None:
        return []
    if isinstance(theirs, dict) and isinstance(ours, dict):
        absent = [f"{at}/{key}" for key in theirs if key not in ours]
        return absent + [m for key in theirs if key in ours for m in missing(theirs[key], ours[key], f"{at}/{key}")]
    if isinstance(theirs, list) and isinstance(ours, list):
        return missing(theirs[0], ours[0], f"{at}[]")
    return [] if theirs == ours else [f"{at}: {theirs} in theirs, {ours} in ours"]


@pytest.fixture
def written(tmp_path: Path) -> tuple[Any, dict[str, Any]]:
    scene = make_scene(n_frames=FRAMES)
    lane = scene.road.lanes[0].lane_id
    lights = Signals(("1",), ((lane,),), np.full((1, FRAMES), SignalState.RED, np.int8))
    with CorpusWriter(tmp_path / "c", source="made", configuration={}) as writer:
        writer.add(replace(scene, signals=lights, t0_frame=10))
        corpus = writer.finish()
    export("gpudrive", corpus, out=tmp_path / "out")
    (file,) = (tmp_path / "out").rglob("*.json")
    return next(iter(corpus)), json.loads(file.read_text())


def test_every_field_of_the_published_files_is_there(written: Any, shared_data: Path) -> None:
    folder = shared_data / "womd" / "json"
    if not folder.is_dir():
        pytest.skip(f"no files of GPUDrive at {folder}")
    _, document = written
    published = merged([shape_of(json.loads(file.read_text())) for file in sorted(folder.glob("*.json"))])
    assert missing(published, shape_of(document)) == []
    assert missing({"objects": [{"type": "str", "colour": "str"}]}, shape_of(document)) == ["/objects[]/colour"]


def test_the_numbers_are_those_of_the_corpus(written: Any) -> None:
    """Read by the format's description alone: lists of points by frame, invalid ones at -10000."""
    scene, document = written
    tracks = scene.tracks
    shift = None
    assert len(document["objects"]) == tracks.n_agents
    for made in document["objects"]:
        i = tracks.agent_id.index(made["agent_id"])
        assert all(len(made[name]) == FRAMES for name in ("position", "velocity", "heading", "valid"))
        assert made["valid"] == tracks.valid[i].tolist()
        there = tracks.valid[i]
        place = np.array([(p["x"], p["y"]) for p in made["position"]])
        offset = place[there] - tracks.position_m[i][there]
        shift = offset[0] if shift is None else shift
        np.testing.assert_allclose(offset, np.broadcast_to(shift, offset.shape), atol=1e-3)
        np.testing.assert_allclose(
            [p["x"] for p in made["velocity"]], _or(tracks.velocity_mps[i, :, 0], there), atol=1e-5
        )
        np.testing.assert_allclose(made["heading"], _or(tracks.heading_rad[i], there), atol=1e-6)
        assert (place[~there] == -10_000).all()
        np.testing.assert_allclose((made["length"], made["width"]), tracks.size_m[i], atol=1e-6)
        last = int(np.flatnonzero(there)[-1])
        assert math.isclose(made["goalPosition"]["x"], made["position"][last]["x"])
    ids = [road["id"] for road in document["roads"]]
    assert len(set(ids)) == len(ids)
    (light,) = document["tl_states"].values()
    assert light["state"] == ["stop"] * FRAMES
    target = document["metadata"]["tracks_to_predict"][0]["track_index"]
    assert document["objects"][target]["valid"][10]


def _or(values: np.ndarray, there: np.ndarray) -> np.ndarray:
    return np.where(there, values, -10_000.0)
