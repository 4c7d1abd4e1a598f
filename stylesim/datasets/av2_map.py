"""The vector map of an Argoverse 2 scenario: `log_map_archive_<id>.json`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from stylesim.datasets.guarding import bounded, reading
from stylesim.datasets.polylines import map_line
from stylesim.geometry import arc_length, resampled
from stylesim.road import Lane, Road

# Lanes for motor traffic [read: the lane types of the format are VEHICLE, BUS, BIKE]. A bicycle lane would be
# the nearest "lane" of many a car beside it.
DRIVABLE = ("VEHICLE", "BUS")
MAX_FILE_BYTES = 1 << 28  # chosen: maps have 0.1 to 10 MB
BOUNDARY_POINTS = 20  # chosen: lane segments are 10 to 60 m long, so the centre has a point every 0.5 to 3 m


def read_map(path: Path, origin_m: Float64[np.ndarray, " 2"]) -> Road:
    """The lanes and crosswalks of a map file, in metres from `origin_m`.

    Centre lines are the file's own where it gives them, else the middle of the boundaries. Ids of successors and
    neighbours outside the map are left out. InputError where the file is damaged or no such map.
    """
    bounded(path, MAX_FILE_BYTES)
    with reading(path, "Argoverse 2 map"):
        document = json.loads(path.read_bytes())
        segments = [s for s in document["lane_segments"].values() if s["lane_type"] in DRIVABLE]
        known = {str(s["id"]) for s in segments}
        lanes = tuple(_lane(segment, known, origin_m) for segment in segments)
        walks = tuple(_crosswalk(c, origin_m) for c in document.get("pedestrian_crossings", {}).values())
        return Road(lanes=lanes, source="map", crosswalks_m=walks)


def _lane(segment: Mapping[str, Any], known: set[str], origin_m: Float64[np.ndarray, " 2"]) -> Lane:
    left = _points(segment["left_lane_boundary"], origin_m)
    right = _points(segment["right_lane_boundary"], origin_m)
    centre = _points(segment["centerline"], origin_m) if segment.get("centerline") else _middle(left, right)
    return Lane(
        lane_id=str(segment["id"]),
        centre_line_m=centre,
        width_m=float(np.median(np.hypot(*(_even(left) - _even(right)).T))),
        left_boundary_m=left,
        right_boundary_m=right,
        successors=tuple(str(i) for i in segment["successors"] if str(i) in known),
        left_neighbour=_neighbour(segment["left_neighbor_id"], known),
        right_neighbour=_neighbour(segment["right_neighbor_id"], known),
        in_junction=bool(segment["is_intersection"]),
    )


def _neighbour(lane_id: Any, known: set[str]) -> str:
    return str(lane_id) if lane_id is not None and str(lane_id) in known else ""


def _points(
    points: Sequence[Mapping[str, float]], origin_m: Float64[np.ndarray, " 2"]
) -> Float32[np.ndarray, "point 2"]:
    return map_line([[p["x"], p["y"]] for p in points], origin_m)


def _even(line_m: Float32[np.ndarray, "point 2"]) -> Float64[np.ndarray, "sample 2"]:
    length = float(arc_length(line_m)[-1])
    even = resampled(line_m.astype(np.float64), max(length / (BOUNDARY_POINTS - 1), 1e-6) * (1 + 1e-9))
    at = np.linspace(0, len(even) - 1, BOUNDARY_POINTS).round().astype(int)
    return even[at]


def _middle(left: Float32[np.ndarray, "l 2"], right: Float32[np.ndarray, "r 2"]) -> Float32[np.ndarray, "point 2"]:
    return ((_even(left) + _even(right)) / 2).astype(np.float32)


def _crosswalk(crossing: Mapping[str, Any], origin_m: Float64[np.ndarray, " 2"]) -> Float32[np.ndarray, "corner 2"]:
    one, other = _points(crossing["edge1"], origin_m), _points(crossing["edge2"], origin_m)
    return np.concatenate([one, other[::-1]])
