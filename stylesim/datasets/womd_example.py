"""A `tf.Example` of Waymo Open Motion (waymo.com/open/data/motion/tfexample) as a `Scene`.

It has at most 128 agents and no lane topology: lanes are runs of road-graph points with one id, and follow one
another where their ends meet. Invalid states are padding, not rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.datasets import wire
from stylesim.datasets.accounting import row_counts
from stylesim.datasets.clocks import refuse_irregular
from stylesim.datasets.dense import checked_tracks, origin_of, size_when_seen
from stylesim.datasets.light_states import WAYMO
from stylesim.datasets.polyline_map import PolylineLane, PolylineMap, road_of
from stylesim.datasets.womd_scenario import DT_S, KINDS, SOURCE, signals_of
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.signals import Signals, SignalState
from stylesim.tracks import AgentKind, TrackFlag

STEPS = (("past", 10), ("current", 1), ("future", 80))  # by definition of the format
N_FRAMES, T0_FRAME = 91, 10
_FREEWAY, _STREET, _CROSSWALK = 1, 2, 18  # roadgraph_samples/type
Features = Mapping[str, Any]


def scene_of_example(data: bytes, message: wire.Fields, file: Path, name: str, split: str) -> Scene:
    """The scene of one record; `name` stands in for a missing scenario/id. Raises what bad bytes raise."""
    features = _features(data, message)
    found = features.get("scenario/id")
    scenario_id = found[0].decode("utf-8") if found else name
    ids, kinds = np.asarray(features["state/id"]), np.asarray(features["state/type"])
    n = len(ids)
    state = {key: _over_time(features, f"state/{{}}/{key}", n) for key in (
        "x", "y", "length", "width", "bbox_yaw", "velocity_x", "velocity_y", "valid", "timestamp_micros",
    )}  # fmt: skip
    there = np.isfinite(ids) & (ids >= 0)
    valid = (state["valid"] > 0) & there[:, None]
    if not valid.any():
        raise ValueError("no agent is ever valid")
    stamped = valid[int(valid.sum(axis=1).argmax())]
    frames = np.flatnonzero(stamped)
    times = state["timestamp_micros"][int(valid.sum(axis=1).argmax()), frames] / 1e6
    if (np.diff(frames) == 1).all():
        refuse_irregular(times, DT_S, file)
    position = np.stack([state["x"], state["y"]], -1)
    origin = origin_of(position, valid)
    rows = np.flatnonzero(there)
    tracks, dropped = checked_tracks(
        agent_id=_unique(ids[rows]),
        kind=np.array([int(KINDS.get(int(k), AgentKind.OTHER)) for k in np.nan_to_num(kinds[rows])]),
        size_m=size_when_seen(np.stack([state["length"], state["width"]], -1), valid, T0_FRAME)[rows],
        position_m=position[rows],
        velocity_mps=np.stack([state["velocity_x"], state["velocity_y"]], -1)[rows],
        heading_rad=state["bbox_yaw"][rows],
        valid=valid[rows],
        dt_s=DT_S,
        origin_m=origin,
        file=file,
        flags=_flags(features, n)[rows],
    )
    signals, stops = _signals(features)
    return Scene(
        scene_id=f"womd_{scenario_id}",
        unit_id=f"womd_{scenario_id}",
        source=SOURCE,
        scenario="womd",
        tracks=tracks,
        road=_road(features, stops, origin),
        signals=signals,
        source_scenario_id=scenario_id,
        official_split=split,
        t0_frame=T0_FRAME,
        counts=row_counts(rows_in=int(valid.sum()), rows_out=int(tracks.valid.sum()), dropped=dropped),
    )


def _features(data: bytes, message: wire.Fields) -> dict[str, Any]:
    """Every feature by name: a list of bytes, or an array of floats or integers."""
    result: dict[str, Any] = {}
    for span in wire.spans(wire.fields(data, wire.spans(message, 1)[0]), 1):
        entry = wire.fields(data, span)
        feature = wire.fields(data, wire.spans(entry, 2)[-1])
        name = wire.text(data, entry, 1)
        for kind in (1, 2, 3):
            if kind in feature:
                values = wire.fields(data, wire.spans(feature, kind)[-1])
                if kind == 1:
                    result[name] = [data[start:end] for start, end in wire.spans(values, 1)]
                elif kind == 2:
                    joined = b"".join(data[start:end] for start, end in wire.spans(values, 1))
                    result[name] = np.frombuffer(joined, "<f4").astype(np.float64)
                else:
                    result[name] = wire.integers(data, values, 1).astype(np.float64)
    return result


def _unique(ids: np.ndarray) -> list[str]:
    names = [str(int(i)) for i in ids]
    if len(set(names)) != len(names):
        raise ValueError("two agents have one id")
    return names


def _over_time(features: Features, name: str, n: int) -> np.ndarray:
    parts = [np.asarray(features[name.format(when)], np.float64).reshape(n, steps) for when, steps in STEPS]
    return np.concatenate(parts, axis=1)


def _flags(features: Features, n: int) -> np.ndarray:
    flags = np.zeros(n, np.int32)
    for name, flag in (("state/is_sdc", TrackFlag.EGO), ("state/tracks_to_predict", TrackFlag.FOCAL)):
        if name in features:
            flags |= np.where(np.asarray(features[name]).reshape(n) > 0, np.int32(flag), np.int32(0))
    return flags


def _signals(features: Features) -> tuple[Signals | None, dict[str, Any]]:
    parts = []
    for when, steps in STEPS:
        prefix = f"traffic_light_state/{when}/"
        if prefix + "id" not in features:
            return None, {}
        columns = [np.asarray(features[prefix + key]).reshape(steps, -1) for key in ("id", "state", "valid", "x", "y")]
        if any(column.shape != columns[0].shape for column in columns):
            raise ValueError(f"{prefix}: its features differ in shape")
        parts.append(np.stack(columns))
    if len({part.shape[2] for part in parts}) > 1:
        raise ValueError("traffic_light_state: past, current and future differ in shape")
    lane, state, valid, x, y = np.concatenate(parts, axis=1)
    shown: dict[str, np.ndarray] = {}
    stops: dict[str, Any] = {}
    for frame, light in np.argwhere((valid > 0) & (lane >= 0)).tolist():
        key = str(int(lane[frame, light]))
        shown.setdefault(key, np.full(N_FRAMES, int(SignalState.UNKNOWN), np.int8))
        shown[key][frame] = int(WAYMO[int(state[frame, light])])
        stops.setdefault(key, (x[frame, light], y[frame, light]))
    return signals_of(shown), stops


def _road(features: Features, stops: dict[str, Any], origin_m: np.ndarray) -> Road | None:
    if "roadgraph_samples/xyz" not in features:
        return None
    xyz = np.asarray(features["roadgraph_samples/xyz"]).reshape(-1, 3)
    key, kind, valid = (
        np.asarray(features[f"roadgraph_samples/{name}"]).reshape(-1) for name in ("id", "type", "valid")
    )
    if not len(xyz) == len(key) == len(kind) == len(valid):
        raise ValueError("roadgraph_samples: its features differ in length")
    there = valid > 0
    xyz, key, kind = xyz[there], key[there], kind[there]
    result = PolylineMap(stops=stops)
    starts = np.flatnonzero(np.diff(key, prepend=np.nan) != 0)
    for rows in np.split(np.arange(len(key)), starts[1:]) if len(key) else []:
        if kind[rows[0]] in (_FREEWAY, _STREET):
            result.lanes.append(PolylineLane(lane_id=str(int(key[rows[0]])), points=xyz[rows]))
        elif kind[rows[0]] == _CROSSWALK:
            result.crosswalks.append(xyz[rows])
    if len({lane.lane_id for lane in result.lanes}) != len(result.lanes):
        raise ValueError("the points of a lane are not together")
    return road_of(result, origin_m, link_ends=True) if result.lanes else None
