"""Waymo Open Motion: `Scenario` protos in a TFRecord file (waymo_open_dataset/protos/scenario.proto and map.proto)."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from stylesim.datasets.tfrecord import framed
from stylesim.exporting import proto
from stylesim.exporting.base import Names, Styles, Window, boundaries, numbered, shift_m, target_of, windows
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind, TrackFlag

FRAMES, T0 = 91, 10  # by definition of the benchmark
FILE = "stylesim.tfrecord-00000-of-00001"
TYPES = {
    AgentKind.CAR: 1, AgentKind.TRUCK: 1, AgentKind.BUS: 1, AgentKind.MOTORCYCLE: 1, AgentKind.PEDESTRIAN: 2,
    AgentKind.BICYCLE: 3, AgentKind.STATIC: 4, AgentKind.OTHER: 4,
}  # fmt: skip
STATES = {SignalState.RED: 4, SignalState.YELLOW: 5, SignalState.GREEN: 6}  # stop, caution, go; others unknown
MPH = 0.44704
HEIGHT_M = 1.6  # there is none in a corpus; chosen: a car's
STREET = 2  # LaneCenter.TYPE_SURFACE_STREET


class FormatWriter:
    """Windows of 9.1 s, one record each. Ids are numbers; where the source's are not, they are counted.

    The format has no place for styles, ids that are words, dark lights or lanes' widths: styles, original ids and
    their numbers go into `ids.csv` beside it.
    """

    def __init__(self, folder: Path) -> None:
        self._file = (folder / FILE).open("wb")
        self._ids = (folder / "ids.csv").open("w", encoding="utf-8", newline="\n")
        self._columns: list[str] | None = None
        self._names = Names()
        self.counts: Counter[str] = Counter()

    def add(self, scene: Scene, styles: Styles) -> None:
        """Every window of the scene."""
        for window in windows(scene, length=FRAMES, t0=T0, counts=self.counts):
            target = target_of(window)
            if target is None:
                self.counts["windows_without_a_track_to_predict"] += 1
                continue
            name = self._names.of(window)
            self._file.write(framed(scenario(window, name, target)))
            self._list_ids(window, name, styles)
            self.counts["written"] += 1
            self.counts["agent_frames"] += int(window.scene.tracks.valid.sum())
            if window.scene.signals is not None:
                self.counts["dark_light_frames_as_unknown"] += int(
                    (window.scene.signals.state == SignalState.DARK).sum()
                )

    def _list_ids(self, window: Window, name: str, styles: Styles) -> None:
        if self._columns is None:
            self._columns = sorted({key for found in styles.values() for key in found})
            self._ids.write(",".join(["scenario_id", "object_id", "agent_id", *self._columns]) + "\n")
        number = numbered(window.scene.tracks.agent_id)
        for agent in window.scene.tracks.agent_id:
            found = styles.get(agent, {})
            row = [name, str(number[agent]), agent, *(str(found.get(column, "")) for column in self._columns)]
            self._ids.write(",".join(f'"{item}"' if "," in item else item for item in row) + "\n")

    def finish(self) -> None:
        """Close the files."""
        self._file.close()
        self._ids.close()


def scenario(window: Window, name: str, target: int) -> bytes:
    """One `Scenario` message."""
    scene, tracks = window.scene, window.scene.tracks
    shift = shift_m(scene)
    lanes = {} if scene.road is None else numbered(tuple(lane.lane_id for lane in scene.road.lanes))
    parts = [proto.packed_doubles(1, np.arange(tracks.n_frames) * tracks.dt_s)]
    number = numbered(tracks.agent_id)
    for i, agent in enumerate(tracks.agent_id):
        head = proto.integer(1, number[agent]) + proto.integer(2, TYPES[AgentKind(int(tracks.kind[i]))])
        parts.append(proto.message(2, head + b"".join(proto.message(3, s) for s in _states(scene, i, shift))))
    parts.append(proto.text(5, name))
    ego = np.flatnonzero(tracks.flagged(TrackFlag.EGO))
    parts.append(proto.integer(6, int(ego[0]) if len(ego) else target))
    parts += [proto.message(7, step) for step in _lights(scene, lanes, shift)]
    parts += (
        [] if scene.road is None else [proto.message(8, feature) for feature in _features(scene.road, lanes, shift)]
    )
    parts.append(proto.integer(10, window.t0))
    asked = np.flatnonzero(tracks.flagged(TrackFlag.FOCAL) & tracks.valid[:, window.t0])
    for i in asked.tolist() or [target]:
        parts.append(proto.message(11, proto.integer(1, i) + proto.integer(2, 0)))
    return b"".join(parts)


def _states(scene: Scene, i: int, shift: np.ndarray) -> list[bytes]:
    tracks = scene.tracks
    place = np.nan_to_num(tracks.position_m[i].astype(np.float64) + shift)
    speed, turn = np.nan_to_num(tracks.velocity_mps[i]), np.nan_to_num(tracks.heading_rad[i])
    length, width = np.nan_to_num(tracks.size_m[i]).tolist()
    found = []
    for t in range(tracks.n_frames):
        valid = bool(tracks.valid[i, t])
        state = [proto.double(2, float(place[t, 0])), proto.double(3, float(place[t, 1])), proto.double(4, 0.0)]
        state += [proto.single(n, v) for n, v in ((5, length), (6, width), (7, HEIGHT_M), (8, float(turn[t])))]
        state += [proto.single(9, float(speed[t, 0])), proto.single(10, float(speed[t, 1]))]
        found.append(b"".join(state) + proto.integer(11, valid) if valid else proto.integer(11, 0))
    return found


def _point(x: float, y: float) -> bytes:
    return proto.double(1, x) + proto.double(2, y) + proto.double(3, 0.0)


def _line(number: int, line_m: np.ndarray, shift: np.ndarray) -> bytes:
    return b"".join(proto.message(number, _point(x, y)) for x, y in (line_m.astype(np.float64) + shift).tolist())


def _lights(scene: Scene, lanes: dict[str, int], shift: np.ndarray) -> list[bytes]:
    signals = scene.signals
    if signals is None or scene.road is None:
        return []
    stops = {lane.lane_id: lane for lane in scene.road.lanes}
    steps = []
    for t in range(signals.state.shape[1]):
        entries = []
        for i, names in enumerate(signals.lane_id):
            for name in names:
                if name not in lanes:
                    continue
                stop = stops[name].stop_line_m
                end = stops[name].centre_line_m[-1] if stop is None else stop.mean(axis=0)
                x, y = (end.astype(np.float64) + shift).tolist()
                shown = STATES.get(SignalState(int(signals.state[i, t])), 0)
                entry = proto.integer(1, lanes[name]) + proto.integer(2, shown) + proto.message(3, _point(x, y))
                entries.append(proto.message(1, entry))
        steps.append(b"".join(entries))
    return steps


def _features(road: Road, lanes: dict[str, int], shift: np.ndarray) -> list[bytes]:
    """Lanes with their boundaries as road lines, and crosswalks; numbers of lines go on after those of the lanes."""
    found, free = [], max(lanes.values(), default=0) + 1
    for lane in road.lanes:
        last = len(lane.centre_line_m) - 1
        content = [] if not np.isfinite(lane.speed_limit_mps) else [proto.double(1, lane.speed_limit_mps / MPH)]
        content += [proto.integer(2, STREET), proto.integer(3, lane.in_junction), _line(8, lane.centre_line_m, shift)]
        content += [proto.integer(10, lanes[name]) for name in lane.successors if name in lanes]
        for field, name in ((11, lane.left_neighbour), (12, lane.right_neighbour)):
            if name in lanes:
                beside = proto.integer(1, lanes[name]) + proto.integer(2, 0) + proto.integer(3, last)
                content.append(proto.message(field, beside + proto.integer(4, 0) + proto.integer(5, last)))
        for field, side in zip((13, 14), boundaries(lane), strict=True):
            found.append(proto.integer(1, free) + proto.message(4, proto.integer(1, 0) + _line(2, side, shift)))
            content.append(proto.message(field, proto.integer(1, 0) + proto.integer(2, last) + proto.integer(3, free)))
            free += 1
        found.append(proto.integer(1, lanes[lane.lane_id]) + proto.message(3, b"".join(content)))
    for walk in road.crosswalks_m:
        found.append(proto.integer(1, free) + proto.message(8, _line(1, walk, shift)))
        free += 1
    return found
