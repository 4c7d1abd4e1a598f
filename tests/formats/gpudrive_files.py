"""GPUDrive and Nocturne JSON, written by the tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tests.formats.mutations import mutated_tree
from tests.formats.world import CROSSWALK, LANES, LINES, STOP, World


def _points(line: np.ndarray) -> list[dict[str, float]]:
    return [{"x": float(x), "y": float(y), "z": 0.0} for x, y in line]


def document(scenario_id: str = "abc", *, n_frames: int = 91) -> dict[str, Any]:
    """A scenario as GPUDrive has it."""
    w = World(n_frames=n_frames)
    away = np.where(w.valid[..., None], w.position, -10000.0)
    kinds = {"car": "vehicle"}
    objects = [
        {
            "position": _points(away[a]),
            "width": w.size[a, 1], "length": w.size[a, 0], "height": 1.5,
            "heading": w.heading[a].tolist(),
            "velocity": [{"x": float(x), "y": float(y)} for x, y in w.velocity[a]],
            "valid": w.valid[a].tolist(),
            "goalPosition": _points(away[a])[-1],
            "type": kinds.get(w.kind[a], w.kind[a]), "id": w.id[a], "mark_as_expert": False,
        }
        for a in range(len(w.id))
    ]  # fmt: skip
    roads = [{"geometry": _points(line), "type": "lane", "id": int(key)} for key, line in LANES.items()]
    roads += [{"geometry": _points(line), "type": "road_edge", "id": int(key)} for key, line in LINES.items()]
    roads.append({"geometry": _points(CROSSWALK), "type": "crosswalk", "id": 41})
    roads.append({"geometry": [{"x": 0.0, "y": 0.0, "z": 0.0}], "type": "stop_sign", "id": 42})
    light = {
        "state": ["stop" if t < 40 else "go" for t in range(n_frames)],
        "x": [STOP[0]] * n_frames, "y": [STOP[1]] * n_frames, "z": [0.0] * n_frames,
        "time_index": list(range(n_frames)), "lane_id": ["21"] * n_frames,
    }  # fmt: skip
    return {
        "name": f"{scenario_id}.json",
        "scenario_id": scenario_id,
        "objects": objects,
        "roads": roads,
        "tl_states": {"21": light},
        "metadata": {
            "sdc_track_index": 0,
            "objects_of_interest": [],
            "tracks_to_predict": [{"track_index": 1, "difficulty": 0}],
        },
    }


def write(folder: Path, content: dict[str, Any], name: str = "tfrecord-00000-of-01000_1.json") -> Path:
    """The document as a file."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / name
    file.write_text(json.dumps(content, default=str))
    return file


def sample(folder: Path) -> Path:
    """Two scenarios."""
    write(folder, document("a"))
    write(folder, document("b", n_frames=50), name="tfrecord-00000-of-01000_2.json")
    return folder


_DOCUMENT = document("a")


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage a value."""
    write(folder, mutated_tree(_DOCUMENT, rng))
