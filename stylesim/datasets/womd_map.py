"""The map of a `Scenario` proto (waymo_open_dataset/protos/map.proto)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.datasets import wire
from stylesim.datasets.boundaries import Stretch
from stylesim.datasets.polyline_map import MPH, PolylineLane, PolylineMap

_LANE, _LINE, _EDGE, _CROSSWALK = 3, 4, 5, 8  # MapFeature.feature_data; signs, bumps and driveways are left out
_POINTS = {_LANE: 8, _LINE: 2, _EDGE: 2, _CROSSWALK: 1}  # the field of the feature's points; the first that is there
BIKE_LANE = 3  # LaneCenter.LaneType: a bicycle lane would be the nearest "lane" of many a car beside it

# A MapPoint in which x, y and z are there, in order.
_POINT = np.dtype([("x_tag", "u1"), ("x", "<f8"), ("y_tag", "u1"), ("y", "<f8"), ("z_tag", "u1"), ("z", "<f8")])


def map_of(data: bytes, features: list[wire.Span]) -> PolylineMap:
    """Lanes for motor traffic, their boundaries, and crosswalks, in the source's frame."""
    result = PolylineMap()
    kept: list[tuple[int, str, wire.Fields]] = []
    places: list[Int64[np.ndarray, "point 2"]] = []
    for span in features:
        feature = wire.fields(data, span)
        kind = next((number for number in _POINTS if number in feature), None)
        if kind is None:
            continue
        rest, found = wire.split(data, wire.spans(feature, kind)[-1], _POINTS[kind])
        if kind != _LANE or wire.integer(rest, 2) != BIKE_LANE:
            kept.append((kind, str(wire.integer(feature, 1)), rest))
            places.append(found)
    if not kept:
        return result
    ends = np.cumsum([len(found) for found in places])
    lines = np.split(points(data, np.concatenate(places)), ends[:-1])
    for (kind, key, rest), line in zip(kept, lines, strict=True):
        if kind == _LANE:
            result.lanes.append(_lane(data, key, rest, line))
        elif kind == _CROSSWALK:
            result.crosswalks.append(line)
        else:
            result.lines[key] = line
    ids = [lane.lane_id for lane in result.lanes]
    if len(set(ids)) != len(ids):
        raise ValueError("two lanes have one id")
    return result


def points(data: bytes, found: Sequence[wire.Span] | Int64[np.ndarray, "point 2"]) -> Float64[np.ndarray, "point 3"]:
    """The x, y and z of MapPoints."""
    rows, same = wire.fixed(data, found, _POINT)
    regular = (rows["x_tag"] == 0x09) & (rows["y_tag"] == 0x11) & (rows["z_tag"] == 0x19)
    same[same] = regular
    result = np.full((len(found), 3), np.nan)
    result[same] = np.stack([rows[name][regular] for name in ("x", "y", "z")], -1)
    for i in np.flatnonzero(~same).tolist():
        point = wire.fields(data, (int(found[i][0]), int(found[i][1])))
        result[i] = [wire.real(data, point, number, 0.0) for number in (1, 2, 3)]  # proto2: missing is 0
    return result


def _lane(data: bytes, lane_id: str, lane: wire.Fields, line: Float64[np.ndarray, "point 3"]) -> PolylineLane:
    return PolylineLane(
        lane_id=lane_id,
        points=line,
        speed_limit_mps=wire.real(data, lane, 1) * MPH,
        successors=[str(i) for i in wire.integers(data, lane, 10).tolist()],
        left_boundaries=_stretches(data, lane, 13, feature=3, start=1, end=2),
        right_boundaries=_stretches(data, lane, 14, feature=3, start=1, end=2),
        left_neighbours=_stretches(data, lane, 11, feature=1, start=2, end=3),
        right_neighbours=_stretches(data, lane, 12, feature=1, start=2, end=3),
        in_junction=bool(wire.integer(lane, 3)),  # "interpolating": it joins two lanes
    )


def _stretches(data: bytes, lane: wire.Fields, number: int, *, feature: int, start: int, end: int) -> list[Stretch]:
    found = [wire.fields(data, span) for span in wire.spans(lane, number)]
    return [(str(wire.integer(f, feature)), wire.integer(f, start), wire.integer(f, end)) for f in found]
