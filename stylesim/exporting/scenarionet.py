"""A ScenarioNet database: one pickle a scene, `dataset_summary.pkl` and `dataset_mapping.pkl`.

What UniTraj and MetaDrive read (docs/REFERENCE.md, section 6): native Python and arrays, string keys.
"""

from __future__ import annotations

import pickle
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.exporting.base import Styles, boundaries, shift_m
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.signals import Signals, SignalState
from stylesim.tracks import AgentKind, TrackFlag

PROTOCOL = 4  # read by every Python that these frameworks run on
TYPES = {
    AgentKind.CAR: "VEHICLE", AgentKind.TRUCK: "VEHICLE", AgentKind.BUS: "VEHICLE", AgentKind.MOTORCYCLE: "VEHICLE",
    AgentKind.BICYCLE: "CYCLIST", AgentKind.PEDESTRIAN: "PEDESTRIAN", AgentKind.STATIC: "TRAFFIC_BARRIER",
    AgentKind.OTHER: "OTHER",
}  # fmt: skip
FINER = {AgentKind.TRUCK: "vehicle.truck", AgentKind.BUS: "vehicle.bus", AgentKind.MOTORCYCLE: "vehicle.motorcycle"}
STATES = {
    SignalState.GREEN: "LANE_STATE_GO", SignalState.YELLOW: "LANE_STATE_CAUTION", SignalState.RED: "LANE_STATE_STOP",
    SignalState.DARK: "LANE_STATE_UNKNOWN", SignalState.UNKNOWN: "LANE_STATE_UNKNOWN",
}  # fmt: skip
HEIGHT_M = 1.6  # there is none in a corpus; chosen: a car's
PLAIN = re.compile(r"[^A-Za-z0-9_-]")


class FormatWriter:
    """Scenes of any length. Styles are in each track's metadata; a dark light becomes unknown, and is counted."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._summary: dict[str, Any] = {}
        self.counts: Counter[str] = Counter()

    def add(self, scene: Scene, styles: Styles) -> None:
        """One pickle."""
        if not scene.tracks.valid.any():
            self.counts["scenes_without_road_users"] += 1
            return
        name = f"sd_stylesim_{PLAIN.sub('-', scene.scene_id)}.pkl"
        document = _document(scene, styles)
        (self._folder / name).write_bytes(pickle.dumps(document, protocol=PROTOCOL))
        self._summary[name] = document["metadata"]
        if scene.signals is not None:
            self.counts["dark_light_frames_as_unknown"] += int((scene.signals.state == SignalState.DARK).sum())
            self.counts["lights_without_a_lane"] += sum(not lanes for lanes in scene.signals.lane_id)
        self.counts["written"] += 1
        self.counts["agent_frames"] += int(scene.tracks.valid.sum())

    def finish(self) -> None:
        """The summary of all scenes, and in which folder each is (this one)."""
        for name, content in (("summary", self._summary), ("mapping", dict.fromkeys(self._summary, ""))):
            (self._folder / f"dataset_{name}.pkl").write_bytes(pickle.dumps(content, protocol=PROTOCOL))


def _document(scene: Scene, styles: Styles) -> dict[str, Any]:
    tracks, shift = scene.tracks, shift_m(scene)
    ego = np.flatnonzero(tracks.flagged(TrackFlag.EGO))
    if not len(ego):  # the database needs one: who is seen longest among motor vehicles, else among all
        seen = tracks.valid.sum(axis=1) + 1e6 * tracks.is_motor
        ego = np.array([int(np.argmax(seen))])
    sdc = tracks.agent_id[int(ego[0])]
    t0 = scene.t0_frame if scene.t0_frame is not None else min(20, tracks.n_frames - 1)
    asked = np.flatnonzero(tracks.valid[:, t0] & tracks.is_motor)
    metadata = {
        "id": scene.scene_id,
        "scenario_id": scene.scene_id,
        "dataset": "stylesim",
        "version": "stylesim",
        "coordinate": "right-handed",
        "metadrive_processed": False,
        "ts": np.arange(tracks.n_frames) * tracks.dt_s,
        "sdc_id": sdc,
        "map": scene.scenario,
        "source": scene.source,
        "log_name": scene.unit_id,
        "current_time_index": int(t0),
        "origin_m": (tracks.origin_m - shift).tolist(),  # to be added where the file is in metres from it
        "tracks_to_predict": {
            tracks.agent_id[i]: {
                "track_index": int(i), "track_id": tracks.agent_id[i], "difficulty": 0,
                "object_type": TYPES[AgentKind(int(tracks.kind[i]))],
            }
            for i in asked.tolist()
        },
    }  # fmt: skip
    metadata["number_summary"] = {"num_objects": tracks.n_agents}
    return {
        "id": scene.scene_id,
        "version": "stylesim",
        "length": tracks.n_frames,
        "metadata": metadata,
        "tracks": {agent: _track(scene, i, shift, styles.get(agent, {})) for i, agent in enumerate(tracks.agent_id)},
        "dynamic_map_states": {} if scene.signals is None else _lights(scene.signals, scene.road, shift),
        "map_features": {} if scene.road is None else _features(scene.road, shift),
    }


def _track(scene: Scene, i: int, shift: np.ndarray, style: Any) -> dict[str, Any]:
    tracks = scene.tracks
    valid = tracks.valid[i]
    position = np.zeros((tracks.n_frames, 3))
    position[:, :2] = np.where(valid[:, None], tracks.position_m[i].astype(np.float64) + shift, 0.0)
    kind = AgentKind(int(tracks.kind[i]))
    size = np.nan_to_num(tracks.size_m[i].astype(np.float64))
    return {
        "type": TYPES[kind],
        "state": {
            "position": position,
            "length": np.where(valid, size[0], 0.0),
            "width": np.where(valid, size[1], 0.0),
            "height": np.where(valid, HEIGHT_M, 0.0),
            "heading": np.where(valid, tracks.heading_rad[i], 0.0).astype(np.float64),
            "velocity": np.where(valid[:, None], tracks.velocity_mps[i], 0.0).astype(np.float64),
            "valid": valid.copy(),
        },
        "metadata": {
            "type": FINER.get(kind, TYPES[kind]), "object_id": tracks.agent_id[i], "track_length": tracks.n_frames,
            "dataset": "stylesim", **style,
        },
    }  # fmt: skip


def _lights(signals: Signals, road: Road | None, shift: np.ndarray) -> dict[str, Any]:
    stops = {} if road is None else {lane.lane_id: lane.stop_line_m for lane in road.lanes}
    made = {}
    for i, name in enumerate(signals.signal_id):
        for lane in signals.lane_id[i]:
            stop = stops.get(lane)
            point = np.zeros(3)
            if stop is not None:
                point[:2] = stop.astype(np.float64).mean(axis=0) + shift
            key = name if len(signals.lane_id[i]) == 1 else f"{name}:{lane}"
            made[key] = {
                "type": "TRAFFIC_LIGHT",
                "lane": lane,
                "stop_point": point if stop is not None else None,
                "state": {"object_state": [STATES[SignalState(int(s))] for s in signals.state[i]]},
                "metadata": {"track_length": signals.state.shape[1], "type": "TRAFFIC_LIGHT", "object_id": key,
                             "dataset": "stylesim"},
            }  # fmt: skip
    return made


def _features(road: Road, shift: np.ndarray) -> dict[str, Any]:
    made: dict[str, Any] = {}
    for lane in road.lanes:
        centre = lane.centre_line_m.astype(np.float64) + shift
        last = len(centre) - 1
        entry: dict[str, Any] = {
            "type": "LANE_SURFACE_STREET",
            "polyline": np.column_stack([centre, np.zeros(len(centre))]),
            "entry_lanes": [other.lane_id for other in road.lanes if lane.lane_id in other.successors],
            "exit_lanes": list(lane.successors),
            "interpolating": lane.in_junction,
            "left_boundaries": [], "right_boundaries": [], "left_neighbor": [], "right_neighbor": [],
        }  # fmt: skip
        if np.isfinite(lane.speed_limit_mps):
            entry["speed_limit_kmh"] = float(lane.speed_limit_mps) * 3.6
            entry["speed_limit_mph"] = float(lane.speed_limit_mps) / 0.44704
        for side, line in zip(("left", "right"), boundaries(lane), strict=True):
            key = f"{lane.lane_id}:{side}"
            made[key] = {
                "type": "ROAD_LINE_SOLID_SINGLE_WHITE",
                "polyline": np.column_stack([line + shift, np.zeros(len(line))]),
            }
            entry[f"{side}_boundaries"].append(
                {"lane_start_index": 0, "lane_end_index": last, "boundary_type": "UNKNOWN", "boundary_feature_id": key}
            )
        for side, name in (("left", lane.left_neighbour), ("right", lane.right_neighbour)):
            if name:
                entry[f"{side}_neighbor"].append(
                    {"feature_id": name, "self_start_index": 0, "self_end_index": last,
                     "neighbor_start_index": 0, "neighbor_end_index": last, "boundaries": []}
                )  # fmt: skip
        made[lane.lane_id] = entry
    for i, walk in enumerate(road.crosswalks_m):
        corners = walk.astype(np.float64) + shift
        made[f"crosswalk_{i}"] = {"type": "CROSSWALK", "polygon": np.column_stack([corners, np.zeros(len(corners))])}
    return made
