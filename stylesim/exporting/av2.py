"""Argoverse 2 motion forecasting: a folder for each scenario of 110 frames, with Parquet and map."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.exporting.base import Names, Styles, Window, boundaries, cut, numbered, target_of, windows
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.tracks import AgentKind, TrackFlag

FRAMES, T0 = 110, 49  # by definition of the benchmark
FRAME_NS = 100_000_000
TYPES = {
    AgentKind.CAR: "vehicle", AgentKind.TRUCK: "vehicle", AgentKind.BUS: "bus", AgentKind.MOTORCYCLE: "motorcyclist",
    AgentKind.BICYCLE: "cyclist", AgentKind.PEDESTRIAN: "pedestrian", AgentKind.STATIC: "static",
    AgentKind.OTHER: "unknown",
}  # fmt: skip
FRAGMENT, UNSCORED, SCORED, FOCAL = range(4)  # av2's TrackCategory
PLAIN = re.compile(r"[^A-Za-z0-9_-]")


class FormatWriter:
    """Folders `<id>/scenario_<id>.parquet` and `log_map_archive_<id>.json`, in the source's own metres.

    Windows of 11 s; a scene of 50 frames with its t0 at the end is a scenario of the test split. Each has one focal
    track (see `target_of`); windows without anybody to ask about are counted. Styles are extra columns of the Parquet.
    Sizes, lights and speed limits have no place in the format.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._names = Names()
        self.counts: Counter[str] = Counter()

    def add(self, scene: Scene, styles: Styles) -> None:
        """Every window of the scene."""
        if scene.t0_frame == T0 and scene.tracks.n_frames < FRAMES:
            found = [Window(cut(scene, 0, T0 + 1), 0, T0)]
        else:
            found = windows(scene, length=FRAMES, t0=T0, counts=self.counts)
        for window in found:
            self._scenario(window, self._names.of(window, plain=PLAIN), styles)

    def _scenario(self, window: Window, name: str, styles: Styles) -> None:
        focal = target_of(window)
        if focal is None:
            self.counts["windows_without_a_focal_track"] += 1
            return
        if window.scene.road is None:
            self.counts["scenarios_without_a_map"] += 1
        folder = self._folder / window.scene.official_split / name
        folder.mkdir(parents=True)
        _table(window, name, focal, styles).write_parquet(folder / f"scenario_{name}.parquet")
        document = _map(window.scene.road or Road(()), window.scene.tracks.origin_m)
        (folder / f"log_map_archive_{name}.json").write_text(json.dumps(document), encoding="utf-8")
        self.counts["written"] += 1
        self.counts["agent_frames"] += int(window.scene.tracks.valid.sum())

    def finish(self) -> None:
        """Nothing stands once per data set."""


def _table(window: Window, name: str, focal: int, styles: Styles) -> pl.DataFrame:
    scene, tracks = window.scene, window.scene.tracks
    agent, frame = np.nonzero(tracks.valid)
    whole = tracks.valid.all(axis=1) & (tracks.kind != AgentKind.STATIC)
    category = np.where(whole, SCORED, np.where(tracks.valid[:, T0], UNSCORED, FRAGMENT))
    category[focal] = FOCAL
    ego = tracks.flagged(TrackFlag.EGO)
    ids = np.array(["AV" if ego[i] and ego.sum() == 1 else a for i, a in enumerate(tracks.agent_id)], object)
    position = tracks.position_m[agent, frame].astype(np.float64) + tracks.origin_m
    velocity = tracks.velocity_mps[agent, frame].astype(np.float64)
    start = round(scene.start_s * 1e9)
    kinds = np.array([TYPES[AgentKind(int(k))] for k in tracks.kind], object)
    columns: dict[str, Any] = {
        "observed": frame <= T0,
        "track_id": ids[agent].tolist(),
        "object_type": kinds[agent].tolist(),
        "object_category": category[agent].astype(np.int64),
        "timestep": frame.astype(np.int64),
        "position_x": position[:, 0],
        "position_y": position[:, 1],
        "heading": tracks.heading_rad[agent, frame].astype(np.float64),
        "velocity_x": velocity[:, 0],
        "velocity_y": velocity[:, 1],
        "scenario_id": [name] * len(agent),
        "start_timestamp": np.full(len(agent), start, np.int64),
        "end_timestamp": np.full(len(agent), start + (FRAMES - 1) * FRAME_NS, np.int64),
        "num_timestamps": np.full(len(agent), FRAMES, np.int64),
        "focal_track_id": [str(ids[focal])] * len(agent),
        "city": [scene.scenario] * len(agent),
    }
    for column in sorted({key for found in styles.values() for key in found}):
        of_agent = [styles.get(a, {}).get(column) for a in tracks.agent_id]
        columns[column] = [of_agent[i] for i in agent]
    return pl.DataFrame(columns)


def _map(road: Road, origin_m: np.ndarray) -> dict[str, Any]:
    number = numbered(tuple(lane.lane_id for lane in road.lanes))
    before: dict[str, list[int]] = {lane.lane_id: [] for lane in road.lanes}
    for lane in road.lanes:
        for name in lane.successors:
            if name in before:
                before[name].append(number[lane.lane_id])
    segments = {str(number[lane.lane_id]): _segment(lane, number, before, origin_m) for lane in road.lanes}
    return {
        "lane_segments": segments,
        "drivable_areas": {str(i): _area(lane, i, origin_m) for i, lane in enumerate(road.lanes)},
        "pedestrian_crossings": {str(i): _crossing(walk, i, origin_m) for i, walk in enumerate(road.crosswalks_m)},
    }


def _points(line_m: np.ndarray, origin_m: np.ndarray) -> list[dict[str, float]]:
    return [{"x": float(x), "y": float(y), "z": 0.0} for x, y in line_m.astype(np.float64) + origin_m]


def _segment(lane: Lane, number: dict[str, int], before: dict[str, list[int]], origin_m: np.ndarray) -> dict[str, Any]:
    left, right = boundaries(lane)
    return {
        "id": number[lane.lane_id],
        "is_intersection": lane.in_junction,
        "lane_type": "VEHICLE",
        "centerline": _points(lane.centre_line_m, origin_m),
        "left_lane_boundary": _points(left, origin_m),
        "right_lane_boundary": _points(right, origin_m),
        "left_lane_mark_type": "UNKNOWN",
        "right_lane_mark_type": "UNKNOWN",
        "left_neighbor_id": number.get(lane.left_neighbour),
        "right_neighbor_id": number.get(lane.right_neighbour),
        "successors": [number[name] for name in lane.successors if name in number],
        "predecessors": before[lane.lane_id],
    }


def _area(lane: Lane, number: int, origin_m: np.ndarray) -> dict[str, Any]:
    left, right = boundaries(lane)
    return {"id": number, "area_boundary": _points(np.concatenate([left, right[::-1]]), origin_m)}


def _crossing(walk_m: np.ndarray, number: int, origin_m: np.ndarray) -> dict[str, Any]:
    half = len(walk_m) // 2
    edges = (walk_m[:half], walk_m[half:][::-1])
    return {"id": number, "edge1": _points(edges[0], origin_m), "edge2": _points(edges[1], origin_m)}
