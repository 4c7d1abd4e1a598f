"""The tracks of a ScenarioNet scenario as arrays by agent and frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.datasets.clocks import refuse_irregular
from stylesim.datasets.dense import origin_of, size_when_seen
from stylesim.datasets.differences import causal_velocity
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.tracks import AgentKind, TrackFlag

DT_S = 0.1
KEY_STEPS = 5  # nuScenes: key frames at 2 Hz, everything between them is interpolated by ScenarioNet
POSE_STRIDE = 2  # frames; chosen: differences of measured poses over 0.2 s instead of 0.1 s halve their noise
MAX_AGENTS, MAX_FRAMES = 20_000, 100_000  # chosen: scenarios have some hundred agents, 91 to 400 frames
KINDS = {
    "VEHICLE": AgentKind.CAR,
    "PEDESTRIAN": AgentKind.PEDESTRIAN,
    "CYCLIST": AgentKind.BICYCLE,
    "TRAFFIC_CONE": AgentKind.STATIC,
    "TRAFFIC_BARRIER": AgentKind.STATIC,
}
# nuScenes' own category, kept in a track's metadata, says more.
FINER = {
    "vehicle.truck": AgentKind.TRUCK,
    "vehicle.trailer": AgentKind.OTHER,
    "vehicle.construction": AgentKind.TRUCK,
    "vehicle.bus": AgentKind.BUS,
    "vehicle.motorcycle": AgentKind.MOTORCYCLE,
    "vehicle.bicycle": AgentKind.BICYCLE,
}


@dataclass(frozen=True, eq=False)
class TrackArrays:
    """Keyword arguments of `dense.checked_tracks`, and rows that were dropped before."""

    arrays: dict[str, Any]
    dropped: dict[str, int]
    rows: int  # valid agent-frames of the source


def units_of(meta: Mapping[str, Any], dataset: str, scenario_id: str) -> str:
    """The recording that a scenario is from, as far as its metadata say.

    nuScenes: site and day (its scenes follow one another in a drive); nuPlan: the log; else the scenario itself.
    """
    if meta.get("log_name"):
        return f"{dataset}_{meta['log_name']}"
    if dataset == "nuscenes" and meta.get("map") and meta.get("date"):
        return f"nuscenes_{meta['map']}_{meta['date']}"
    return f"{dataset}_{scenario_id}"


def tracks_of(document: Mapping[str, Any], file: Path) -> TrackArrays:
    """The arrays of a scenario. InputError for the old form, irregular clocks, or tracks of unequal length.

    nuScenes: frames between key frames are marked by how far they look ahead, and velocities, which the file has
    from the next frame, are made anew from key frames up to the present one.
    """
    meta, tracks = document["metadata"], document["tracks"]
    refuse_irregular(np.asarray(meta["ts"], np.float64), DT_S, file)
    n = len(meta["ts"])
    if not 2 <= n <= MAX_FRAMES or not 1 <= len(tracks) <= MAX_AGENTS:
        raise InputError(f"{file} has {len(tracks)} tracks of {n} frames")
    if any(not isinstance(t["state"], Mapping) for t in tracks.values()):
        raise InputError(
            f"{file} is of the old form, in which a track's state is one array whose columns have no names; "
            "convert the data set again with a current ScenarioNet"
        )
    states = [t["state"] for t in tracks.values()]
    position = np.stack([_column(s["position"], n, 2, file) for s in states])
    velocity = np.stack([_column(s["velocity"], n, 2, file) for s in states])
    heading = np.stack([_column(s["heading"], n, 1, file)[:, 0] for s in states])
    valid = np.stack([_column(s["valid"], n, 1, file)[:, 0] for s in states]) > 0.5
    sides = [np.stack([_column(s[k], n, 1, file)[:, 0] for s in states]) for k in ("length", "width")]
    t0 = int(meta.get("current_time_index", n - 1))
    ego = str(meta.get("sdc_id", ""))
    is_ego = np.array([str(key) == ego for key in tracks])
    dropped: dict[str, int] = {}
    rows = int(valid.sum())
    ahead = None
    if str(meta.get("dataset")) == "nuscenes":
        velocity, ahead = _from_key_frames(position, valid, is_ego)
        unknown = valid & np.isnan(velocity).any(-1)
        dropped["velocity_unknown"] = int(unknown.sum())
        valid &= ~unknown
    arrays = {
        "agent_id": [str(key) for key in tracks],
        "kind": np.array([int(_kind(t)) for t in tracks.values()]),
        "size_m": size_when_seen(np.stack(sides, -1), valid, t0),
        "position_m": position,
        "velocity_mps": velocity,
        "heading_rad": wrap_angle(heading),
        "valid": valid,
        "origin_m": origin_of(position, valid),
        "flags": _flags(tracks, is_ego, meta.get("tracks_to_predict") or {}),
        "lookahead_steps": ahead,
    }
    return TrackArrays(arrays, dropped, rows)


def _column(values: Any, n: int, width: int, file: Path) -> np.ndarray:
    """The first `width` columns, one row per frame; a scalar holds for all frames."""
    array = np.asarray(values, np.float64)
    if array.ndim == 0:
        array = np.full((n, 1), float(array))
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or len(array) != n or array.shape[1] < width:
        raise InputError(f"{file}: a state has the shape {array.shape} where {n} frames are needed")
    return array[:, :width]


def _kind(track: Mapping[str, Any]) -> AgentKind:
    detail = str((track.get("metadata") or {}).get("type", ""))
    for prefix, kind in FINER.items():
        if detail.startswith(prefix):
            return kind
    return KINDS.get(str(track["type"]), AgentKind.OTHER)


def _flags(tracks: Mapping[str, Any], is_ego: np.ndarray, predicted: Any) -> np.ndarray:
    focal = {str(key) for key in predicted}
    flags = np.where(is_ego, np.int32(TrackFlag.EGO), np.int32(0))
    return flags | np.array([int(TrackFlag.FOCAL) if str(key) in focal else 0 for key in tracks], np.int32)


def _from_key_frames(position: np.ndarray, valid: np.ndarray, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocities from key frames, and how far each frame looks ahead; `measured` agents have every frame."""
    n = valid.shape[1]
    velocity, ahead = causal_velocity(position, valid, np.arange(n) * DT_S, POSE_STRIDE)
    keys = np.arange(0, n, KEY_STEPS)
    at_keys, keys_ahead = causal_velocity(position[:, keys], valid[:, keys], keys * DT_S)
    frame = np.arange(n)
    before = np.minimum(frame // KEY_STEPS, len(keys) - 1)
    after = np.minimum(-(-frame // KEY_STEPS), len(keys) - 1)
    share = ((frame - keys[before]) / KEY_STEPS)[:, None]
    between = at_keys[:, before] * (1 - share) + at_keys[:, after] * share
    reach = np.maximum(
        keys[after] - frame + keys_ahead[:, after] * KEY_STEPS, keys[before] - frame + keys_ahead[:, before] * KEY_STEPS
    )
    others = ~measured
    velocity[others], ahead[others] = between[others], np.maximum(reach, 0)[others]
    return velocity, ahead
