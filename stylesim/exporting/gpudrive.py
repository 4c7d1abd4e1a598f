"""GPUDrive JSON: one file for each window of 9.1 s."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.exporting.base import Names, Styles, Window, boundaries, numbered, shift_m, target_of, windows
from stylesim.exporting.womd import FRAMES, HEIGHT_M, STATES, T0
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind, TrackFlag

TYPES = {
    AgentKind.CAR: "vehicle", AgentKind.TRUCK: "vehicle", AgentKind.BUS: "vehicle", AgentKind.MOTORCYCLE: "vehicle",
    AgentKind.PEDESTRIAN: "pedestrian", AgentKind.BICYCLE: "cyclist",
}  # fmt: skip
INVALID = -10000.0  # where an object is not seen, as in the files of the data set
PLAIN = re.compile(r"[^A-Za-z0-9_-]")


class FormatWriter:
    """Files `tfrecord-<id>.json` (GPUDrive looks for that prefix).

    Lanes are bare lines: topology, limits and widths have no place in them. Styles are fields of the objects.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._names = Names()
        self.counts: Counter[str] = Counter()

    def add(self, scene: Scene, styles: Styles) -> None:
        """Every window of the scene."""
        for window in windows(scene, length=FRAMES, t0=T0, counts=self.counts):
            target = target_of(window)
            if target is None:
                self.counts["windows_without_a_track_to_predict"] += 1
                continue
            name = self._names.of(window, plain=PLAIN)
            document = _document(window, name, target, styles, self.counts)
            (self._folder / f"tfrecord-{name}.json").write_text(json.dumps(document), encoding="utf-8")
            self.counts["written"] += 1

    def finish(self) -> None:
        """Nothing stands once per data set."""


def _document(window: Window, name: str, target: int, styles: Styles, counts: Counter[str]) -> dict[str, Any]:
    scene, tracks = window.scene, window.scene.tracks
    shift = shift_m(scene)
    kept = [i for i in range(tracks.n_agents) if AgentKind(int(tracks.kind[i])) in TYPES]
    counts["agents_of_unknown_kinds"] += tracks.n_agents - len(kept)
    counts["agent_frames"] += int(tracks.valid[kept].sum())
    place = {i: k for k, i in enumerate(kept)}
    ego = [i for i in np.flatnonzero(tracks.flagged(TrackFlag.EGO)).tolist() if i in place]
    focal = [i for i in np.flatnonzero(tracks.flagged(TrackFlag.FOCAL)).tolist() if i in place] or [target]
    number = numbered(tracks.agent_id)
    asked = [{"track_index": place[i], "difficulty": 0} for i in focal]
    return {
        "name": f"{name}.json",
        "scenario_id": name,
        "objects": [_object(scene, i, number, shift, styles) for i in kept],
        "roads": _roads(scene, shift),
        "tl_states": _lights(scene, shift, counts),
        "metadata": {
            "sdc_track_index": place[ego[0] if ego else target], "tracks_to_predict": asked, "objects_of_interest": [],
        },
    }  # fmt: skip


def _object(scene: Scene, i: int, number: dict[str, int], shift: np.ndarray, styles: Styles) -> dict[str, Any]:
    tracks = scene.tracks
    valid = tracks.valid[i]
    place = np.where(valid[:, None], tracks.position_m[i].astype(np.float64) + shift, INVALID)
    speed = np.where(valid[:, None], tracks.velocity_mps[i].astype(np.float64), INVALID)
    turn = np.where(valid, tracks.heading_rad[i].astype(np.float64), INVALID)
    length, width = np.nan_to_num(tracks.size_m[i].astype(np.float64)).tolist()
    agent = tracks.agent_id[i]
    return {
        "id": number[agent], "type": TYPES[AgentKind(int(tracks.kind[i]))], "is_sdc": False, "mark_as_expert": False,
        "width": width, "length": length, "height": HEIGHT_M,
        "position": [{"x": x, "y": y, "z": 0.0} for x, y in place.tolist()],
        "velocity": [{"x": x, "y": y} for x, y in speed.tolist()],
        "heading": turn.tolist(),
        "valid": valid.tolist(),
        "goalPosition": _goal(place, valid),
        "agent_id": agent, **styles.get(agent, {}),
    }  # fmt: skip


def _goal(place: np.ndarray, valid: np.ndarray) -> dict[str, float]:
    """Where it is last seen."""
    x, y = place[int(np.flatnonzero(valid)[-1])].tolist()
    return {"x": x, "y": y, "z": 0.0}


def _roads(scene: Scene, shift: np.ndarray) -> list[dict[str, Any]]:
    if scene.road is None:
        return []
    lanes = numbered(tuple(lane.lane_id for lane in scene.road.lanes))
    free = max(lanes.values(), default=0) + 1
    found = []

    def points(line: np.ndarray) -> list[dict[str, float]]:
        return [{"x": x, "y": y, "z": 0.0} for x, y in (line.astype(np.float64) + shift).tolist()]

    for lane in scene.road.lanes:
        found.append({"id": lanes[lane.lane_id], "type": "lane", "map_element_id": 2,
                      "geometry": points(lane.centre_line_m)})  # fmt: skip
        for side in boundaries(lane):
            found.append({"id": free, "type": "road_line", "map_element_id": 6, "geometry": points(side)})
            free += 1
    for walk in scene.road.crosswalks_m:
        found.append({"id": free, "type": "crosswalk", "map_element_id": 18, "geometry": points(walk)})
        free += 1
    return found


def _lights(scene: Scene, shift: np.ndarray, counts: Counter[str]) -> dict[str, Any]:
    if scene.signals is None or scene.road is None:
        return {}
    lanes = numbered(tuple(lane.lane_id for lane in scene.road.lanes))
    ends = {lane.lane_id: lane.centre_line_m[-1] if lane.stop_line_m is None else lane.stop_line_m.mean(axis=0)
            for lane in scene.road.lanes}  # fmt: skip
    names = {4: "stop", 5: "caution", 6: "go", 0: "unknown"}
    found: dict[str, Any] = {}
    counts["dark_light_frames_as_unknown"] += int((scene.signals.state == SignalState.DARK).sum())
    for i, controlled in enumerate(scene.signals.lane_id):
        shown = [STATES.get(SignalState(int(s)), 0) for s in scene.signals.state[i]]
        for lane in controlled:
            if lane in lanes:
                x, y = (ends[lane].astype(np.float64) + shift).tolist()
                n = len(shown)
                found[str(lanes[lane])] = {
                    "state": [names[s] for s in shown], "x": [x] * n, "y": [y] * n, "z": [0.0] * n,
                    "time_index": list(range(n)), "lane_id": [lanes[lane]] * n,
                }  # fmt: skip
    return found
