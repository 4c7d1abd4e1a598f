"""The map expansion of nuScenes (maps/expansion/<location>.json, version 1.3).

Lanes and lane connectors have their centre line as arcs (`arcline_path_3`: three pieces each, straight, to the left
or to the right, all of one radius), lanes also the nodes of their dividers. Speed limits and neighbours are not in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from stylesim.datasets.guarding import mappings, reading
from stylesim.datasets.json_files import json_document
from stylesim.datasets.polylines import map_line, stop_line_at
from stylesim.geometry import arc_length
from stylesim.road import Lane, Road

MAX_FILE_BYTES = 1 << 29  # chosen: the maps have 20 to 60 MB
SPACING_M = 1.0  # chosen: on the tightest turns (5 m) the chord is then 2.5 cm off the arc
MAX_PATH_M = 5_000.0  # chosen: longer than any lane
STOPPING = ("TRAFFIC_LIGHT", "STOP_SIGN", "YIELD")  # stop_line_type; crossings and turns have none painted
AT_END_M = 3.0  # chosen: a stop line belongs to the lane that ends this close to its area
_ORIGIN = np.zeros(2)
_TURN = {"L": 1.0, "S": 0.0, "R": -1.0}


def read_map(path: Path) -> Road:
    """The road in the map's own frame. InputError where the file is damaged or no such map."""
    with reading(path, "nuScenes map expansion"):
        document = json_document(path, limit_bytes=MAX_FILE_BYTES)
        nodes = {n["token"]: (float(n["x"]), float(n["y"])) for n in document["node"]}
        areas = {p["token"]: p["exterior_node_tokens"] for p in document["polygon"]}
        outline = {token: [nodes[n] for n in areas[token]] for token in areas}
        stops = [
            map_line(outline[s["polygon_token"]], _ORIGIN)
            for s in document["stop_line"]
            if s["stop_line_type"] in STOPPING
        ]
        drivable = [record for record in document["lane"] if record.get("lane_type") != "BIKE"]
        records = [(record, False) for record in drivable] + [(r, True) for r in document["lane_connector"]]
        known = {str(record["token"]) for record, _ in records if document["arcline_path_3"].get(record["token"])}
        lanes = [
            _lane(record, junction, document, nodes, outline, known, stops)
            for record, junction in records
            if str(record["token"]) in known
        ]
        walks = tuple(map_line(outline[c["polygon_token"]], _ORIGIN) for c in document["ped_crossing"])
        return Road(lanes=tuple(lanes), source="map", crosswalks_m=tuple(w for w in walks if len(w) >= 3))


def _lane(
    record: Mapping[str, Any],
    junction: bool,
    document: Mapping[str, Any],
    nodes: Mapping[str, tuple[float, float]],
    outline: Mapping[str, list[tuple[float, float]]],
    known: set[str],
    stops: Sequence[Float32[np.ndarray, "_ 2"]],
) -> Lane:
    token = str(record["token"])
    centre = map_line(
        np.concatenate([arc_points(path) for path in mappings(document["arcline_path_3"][token], "arcline_path_3")]),
        _ORIGIN,
    )
    length = float(arc_length(centre)[-1])
    area = map_line(outline[record["polygon_token"]], _ORIGIN) if record.get("polygon_token") in outline else None
    width = 0.0 if area is None else _area(area) / max(length, 1e-3)
    sides = [
        [nodes[s["node_token"]] for s in record.get(f"{side}_lane_divider_segments") or () if s["node_token"] in nodes]
        for side in ("left", "right")
    ]
    left, right = (map_line(points, _ORIGIN) if len(points) >= 2 else None for points in sides)
    after = (document["connectivity"].get(token) or {}).get("outgoing") or ()
    width_m = width if 1.0 <= width <= 10.0 else float("nan")  # other quotients are of lanes with odd areas
    stop = None if junction else _stop_at(centre, stops)
    return Lane(
        lane_id=token,
        centre_line_m=centre,
        width_m=width_m,
        left_boundary_m=left,
        right_boundary_m=right,
        successors=tuple(dict.fromkeys(str(t) for t in after if str(t) in known)),
        in_junction=junction,
        stop_line_m=None if stop is None else stop_line_at(stop, centre, width_m),
    )


def arc_points(path: Mapping[str, Any]) -> Float64[np.ndarray, "point 2"]:
    """Points at most SPACING_M apart along one path of three arcs. ValueError where it is damaged."""
    x, y, yaw = (float(v) for v in path["start_pose"])
    radius, shape = float(path["radius"]), str(path["shape"])
    lengths = [float(v) for v in path["segment_length"]]
    if len(shape) != len(lengths) or not all(0 <= v <= MAX_PATH_M for v in lengths) or not radius > 0:
        raise ValueError(f"a path of shape {shape!r:.20} with pieces of {lengths!r:.60} m on a radius of {radius} m")
    points = [np.array([[x, y]])]
    for letter, length in zip(shape, lengths, strict=True):
        curvature = _TURN[letter] / radius
        s = np.linspace(0.0, length, max(2, int(np.ceil(length / SPACING_M)) + 1))[1:]
        if curvature:
            dx = (np.sin(yaw + curvature * s) - np.sin(yaw)) / curvature
            dy = (np.cos(yaw) - np.cos(yaw + curvature * s)) / curvature
        else:
            dx, dy = np.cos(yaw) * s, np.sin(yaw) * s
        points.append(np.stack([x + dx, y + dy], -1))
        x, y = points[-1][-1]
        yaw += curvature * length
    return np.concatenate(points)


def _area(outline_m: Float32[np.ndarray, "corner 2"]) -> float:
    x, y = outline_m.astype(np.float64).T
    return float(abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2)


def _stop_at(
    centre_m: Float32[np.ndarray, "point 2"], stops: Sequence[Float32[np.ndarray, "_ 2"]]
) -> Float64[np.ndarray, " 2"] | None:
    """The middle of the stop line's area at the end of a lane; None where there is none."""
    end = centre_m[-1].astype(np.float64)
    for area in stops:
        low, high = area.min(axis=0) - AT_END_M, area.max(axis=0) + AT_END_M
        if (end >= low).all() and (end <= high).all():
            return area.mean(axis=0).astype(np.float64)
    return None
