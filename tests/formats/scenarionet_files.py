"""ScenarioNet pickles, written by the tests."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np

from tests.formats.mutations import mutated_tree
from tests.formats.world import CROSSWALK, LANES, LEFT, LINES, SPEED_LIMIT_MPS, STOP, SUCCESSORS, World

TYPES = {"car": "VEHICLE", "cyclist": "CYCLIST", "pedestrian": "PEDESTRIAN"}


def document(scenario_id: str = "abc", *, n_frames: int = 91, dataset: str = "waymo") -> dict[str, Any]:
    """A scenario as ScenarioNet describes one."""
    w = World(n_frames=n_frames)
    tracks = {}
    for a, number in enumerate(w.id):
        seen = w.valid[a]
        tracks[str(number)] = {
            "type": TYPES[w.kind[a]],
            "state": {
                "position": np.where(seen[:, None], np.c_[w.position[a], np.full(n_frames, 5.0)], 0.0),
                "length": np.where(seen, w.size[a, 0], 0.0),
                "width": np.where(seen, w.size[a, 1], 0.0),
                "height": np.where(seen, 1.5, 0.0),
                "heading": w.heading[a],
                "velocity": np.where(seen[:, None], w.velocity[a], 0.0),
                "valid": seen.copy(),
            },
            "metadata": {"track_length": n_frames, "type": TYPES[w.kind[a]], "object_id": str(number)},
        }
    features: dict[str, Any] = {}
    beside = {"21": ("32", "31"), "22": ("32", "31"), "23": ("33", "32"), "24": ("33", "32")}
    for key, line in LANES.items():
        n = len(line)
        left, right = (
            [{"lane_start_index": 0, "lane_end_index": n - 1, "boundary_type": "x", "boundary_feature_id": int(b)}]
            for b in beside[key]
        )
        beyond = [int(LEFT[key])] if key in LEFT else []
        features[key] = {
            "type": "LANE_SURFACE_STREET", "polyline": np.c_[line, np.zeros(n)], "interpolating": False,
            "speed_limit_mph": SPEED_LIMIT_MPS / 0.44704, "speed_limit_kmh": SPEED_LIMIT_MPS * 3.6,
            "entry_lanes": [], "exit_lanes": [int(s) for s in SUCCESSORS[key]],
            "left_boundaries": left, "right_boundaries": right,
            "left_neighbor": [{"feature_id": i, "self_start_index": 0, "self_end_index": n - 1} for i in beyond],
            "right_neighbor": [],
        }  # fmt: skip
    for key, line in LINES.items():
        features[key] = {"type": "ROAD_LINE_BROKEN_SINGLE_WHITE", "polyline": line}
    features["41"] = {"type": "CROSSWALK", "polygon": CROSSWALK}
    light = {
        "type": "TRAFFIC_LIGHT",
        "state": {"object_state": ["LANE_STATE_STOP" if t < 40 else "LANE_STATE_GO" for t in range(n_frames)]},
        "lane": 21,
        "stop_point": np.array([*STOP, 0.0]),
        "metadata": {"track_length": n_frames, "type": "TRAFFIC_LIGHT", "object_id": "21"},
    }
    return {
        "id": scenario_id,
        "version": "MetaDrive v0.3.0.1",
        "length": n_frames,
        "tracks": tracks,
        "dynamic_map_states": {"21": light},
        "map_features": features,
        "metadata": {
            "ts": np.arange(n_frames) * 0.1, "metadrive_processed": False, "coordinate": "waymo", "dataset": dataset,
            "scenario_id": scenario_id, "sdc_id": "11", "current_time_index": 10,
            "tracks_to_predict": {"12": {"track_index": 1, "track_id": "12", "difficulty": 0}},
        },
    }  # fmt: skip


def write(folder: Path, content: Any, name: str = "sd_waymo_v1_abc.pkl") -> Path:
    """The document as a pickle."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / name
    file.write_bytes(pickle.dumps(content))
    return file


def sample(folder: Path) -> Path:
    """A database with two scenarios in a part, and its two tables."""
    write(folder / "db_0", document("a"), "sd_a.pkl")
    write(folder / "db_0", document("b", n_frames=50), "sd_b.pkl")
    write(folder, {"sd_a.pkl": "db_0", "sd_b.pkl": "db_0"}, "dataset_mapping.pkl")
    return folder


_DOCUMENT = document("a")


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage a value."""
    write(folder / "db_0", mutated_tree(_DOCUMENT, rng), "sd_a.pkl")
