"""nuScenes tables and map expansion, written by the tests after the schema of the devkit's documentation."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from tests.formats.mutations import mutated_tree
from tests.formats.world import CROSSWALK, LANES, LINES, SUCCESSORS, World

BEGIN_US = 1_532_402_927_647_951
CATEGORIES = {"car": "vehicle.car", "cyclist": "vehicle.bicycle", "pedestrian": "human.pedestrian.adult"}
AXLE_TO_CENTRE = 4.084 / 2 - (4.084 - 2.588 - 0.839)
SHIFT = np.array([0.0, 900.0])  # maps of nuScenes have positive coordinates only
LOCATION = "boston-seaport"
JITTER_S = (0.0, 0.05, -0.03)


def _turn(yaw: float) -> list[float]:
    return [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]


def tables(*, n_scenes: int = 2, n_samples: int = 30) -> dict[str, list[dict[str, Any]]]:
    """All tables that a reader of tracks needs; key frames come a little early or late."""
    out: dict[str, list[dict[str, Any]]] = {
        name: [] for name in ("log", "scene", "sample", "sample_data", "ego_pose", "category", "instance",
                              "sample_annotation")
    }  # fmt: skip
    out["log"].append({"token": "log0", "logfile": "n008-2018-08-01", "vehicle": "n008", "date_captured": "2018-08-01",
                       "location": LOCATION})  # fmt: skip
    out["category"] = [{"token": f"c_{k}", "name": v, "description": ""} for k, v in CATEGORIES.items()]
    for s in range(n_scenes):
        late = np.array([JITTER_S[i % 3] for i in range(n_samples)])
        # The world is written at the very time of each key frame: a step of 1 ms, then picked.
        w = World(n_frames=n_samples * 500 + 200, dt_s=0.001)
        at = np.round((np.arange(n_samples) * 0.5 + 0.1 + late) * 1000).astype(int)
        valid = np.ones((len(w.id), n_samples), bool)
        valid[2, :4] = False
        sample = [f"s{s}_{i}" for i in range(n_samples)]
        begin = BEGIN_US + s * 60_000_000
        out["scene"].append({"token": f"scene{s}", "name": f"scene-000{s}", "description": "", "log_token": "log0",
                             "nbr_samples": n_samples, "first_sample_token": sample[0],
                             "last_sample_token": sample[-1]})  # fmt: skip
        out["instance"] += [
            {"token": f"i{s}_{w.id[a]}", "category_token": f"c_{w.kind[a]}"} for a in range(1, len(w.id))
        ]
        for i in range(n_samples):
            time = begin + int(at[i]) * 1000
            out["sample"].append({"token": sample[i], "timestamp": time, "scene_token": f"scene{s}",
                                  "prev": sample[i - 1] if i else "",
                                  "next": sample[i + 1] if i + 1 < n_samples else ""})  # fmt: skip
            axle = w.position[0, at[i]] + SHIFT - [AXLE_TO_CENTRE, 0.0]
            for channel, key in (("LIDAR_TOP", True), ("CAM_FRONT", True), ("LIDAR_TOP", False)):
                pose = f"p{s}_{i}_{channel}_{key}"
                off = 0.0 if key and channel == "LIDAR_TOP" else 3.0
                out["sample_data"].append({"token": pose + "d", "sample_token": sample[i], "ego_pose_token": pose,
                                           "filename": f"samples/{channel}/x.bin", "timestamp": time,
                                           "is_key_frame": key})  # fmt: skip
                out["ego_pose"].append({"token": pose, "timestamp": time, "rotation": _turn(0.0),
                                        "translation": [axle[0] + off, axle[1], 0.0]})  # fmt: skip
            for a in range(1, len(w.id)):
                if valid[a, i]:
                    x, y = (w.position[a, at[i]] + SHIFT).tolist()
                    out["sample_annotation"].append({
                        "token": f"a{s}_{a}_{i}", "sample_token": sample[i], "instance_token": f"i{s}_{w.id[a]}",
                        "translation": [x, y, 1.0], "size": [w.size[a, 1], w.size[a, 0], 1.5],
                        "rotation": _turn(w.heading[a, at[i]]), "num_lidar_pts": 5,
                    })  # fmt: skip
    return out


def expansion() -> dict[str, Any]:
    """The world's lanes as a map expansion."""
    nodes: list[dict[str, Any]] = []
    polygons: list[dict[str, Any]] = []

    def node(x: float, y: float) -> str:
        nodes.append({"token": f"n{len(nodes)}", "x": x + SHIFT[0], "y": y + SHIFT[1]})
        return nodes[-1]["token"]

    def polygon(points: Any) -> str:
        tokens = [node(*p) for p in points]
        polygons.append({"token": f"poly{len(polygons)}", "exterior_node_tokens": tokens, "holes": []})
        return polygons[-1]["token"]

    lanes, connectors, arcs, links = [], [], {}, {}
    sides = {"21": ("32", "31"), "22": ("32", "31"), "23": ("33", "32"), "24": ("33", "32")}
    for key, line in LANES.items():
        (x0, y0), (x1, _) = line[0], line[-1]
        outline = [(x0, y0 - 1.75), (x1, y0 - 1.75), (x1, y0 + 1.75), (x0, y0 + 1.75)]
        record: dict[str, Any] = {"token": key, "polygon_token": polygon(outline)}
        if key in ("21", "23"):
            for side, divider in zip(("left", "right"), sides[key], strict=True):
                record[f"{side}_lane_divider_segments"] = [
                    {"node_token": node(*p), "segment_type": "SINGLE_SOLID_WHITE"} for p in LINES[divider]
                ]
            lanes.append({**record, "lane_type": "CAR"})
        else:
            connectors.append(record)
        start = [x0 + SHIFT[0], y0 + SHIFT[1], 0.0]
        arcs[key] = [{"start_pose": start, "end_pose": [x1 + SHIFT[0], start[1], 0.0], "shape": "LSR", "radius": 900.0,
                      "segment_length": [0.0, float(x1 - x0), 0.0]}]  # fmt: skip
        links[key] = {"incoming": [], "outgoing": list(SUCCESSORS[key])}
    lanes.append({"token": "bike", "polygon_token": polygons[0]["token"], "lane_type": "BIKE"})
    end = LANES["21"][-1]
    stop = polygon(
        [(end[0] - 2, end[1] - 1.75), (end[0], end[1] - 1.75), (end[0], end[1] + 1.75), (end[0] - 2, end[1] + 1.75)]
    )
    return {
        "version": "1.3", "node": nodes, "lane": lanes, "lane_connector": connectors,
        "arcline_path_3": arcs, "connectivity": links,
        "stop_line": [{"token": "st", "polygon_token": stop, "stop_line_type": "TRAFFIC_LIGHT"}],
        "ped_crossing": [{"token": "pc", "polygon_token": polygon(CROSSWALK)}],
        "polygon": polygons,
    }  # fmt: skip


def write(
    root: Path, content: dict[str, Any] | None = None, *, version: str = "v1.0-mini", with_map: bool = True
) -> Path:
    """The data set's root with one version."""
    folder = root / version
    folder.mkdir(parents=True, exist_ok=True)
    for name, rows in (tables() if content is None else content).items():
        (folder / f"{name}.json").write_text(json.dumps(rows, indent=0, default=str))
    if with_map:
        (root / "maps" / "expansion").mkdir(parents=True, exist_ok=True)
        (root / "maps" / "expansion" / f"{LOCATION}.json").write_text(json.dumps(expansion()))
    return root


def sample(folder: Path) -> Path:
    """Two scenes of one log, with map."""
    return write(folder)


_TABLES = tables(n_scenes=1, n_samples=12)
_MAP = expansion()


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage a value of a table or of the map."""
    if rng.random() < 0.3:
        damaged = json.dumps(mutated_tree(_MAP, rng), default=str)
        (folder / "maps" / "expansion" / f"{LOCATION}.json").write_text(damaged)
    else:
        name = list(_TABLES)[rng.integers(len(_TABLES))]
        write(folder, _TABLES | {name: mutated_tree({"rows": _TABLES[name]}, rng).get("rows", [])}, with_map=False)
