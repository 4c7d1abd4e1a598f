"""CommonRoad XML, version 2020a: one file a scene."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import numpy as np

from stylesim.exporting.base import Styles, boundaries, numbered
from stylesim.geometry import resampled
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind

TYPES = {
    AgentKind.CAR: "car", AgentKind.TRUCK: "truck", AgentKind.BUS: "bus", AgentKind.MOTORCYCLE: "motorcycle",
    AgentKind.BICYCLE: "bicycle", AgentKind.PEDESTRIAN: "pedestrian", AgentKind.STATIC: "unknown",
    AgentKind.OTHER: "unknown",
}  # fmt: skip
COLOURS = {SignalState.GREEN: "green", SignalState.YELLOW: "yellow", SignalState.RED: "red",
           SignalState.DARK: "inactive", SignalState.UNKNOWN: "inactive"}  # fmt: skip
LIMIT_SIGN = "274"  # the German sign of a maximum speed, in m/s in this format
PLAIN = re.compile(r"[^A-Za-z0-9]")
LEAST_SIZE_M = 0.1  # the format refuses rectangles without size


class FormatWriter:
    """Lanelets, obstacles, limits as signs, lights as the cycle that was seen. Styles are columns of ids.csv.

    An obstacle is one unbroken run of frames: who is seen, lost and seen again becomes several, counted.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._ids: list[str] = []
        self._columns: list[str] = []
        self.counts: Counter[str] = Counter()

    def add(self, scene: Scene, styles: Styles) -> None:
        """One file."""
        if not scene.tracks.valid.any():
            self.counts["scenes_without_road_users"] += 1
            return
        place = PLAIN.sub("", scene.scenario) or "Site"
        name = f"ZAM_{place}-{self.counts['written'] + 1}_1_T-1"
        root = ET.Element("commonRoad", {
            "timeStepSize": f"{scene.tracks.dt_s:g}", "commonRoadVersion": "2020a", "author": "stylesim",
            "affiliation": "stylesim", "source": scene.source, "benchmarkID": name, "date": "2000-01-01",
        })  # fmt: skip
        location = ET.SubElement(root, "location")
        for tag, text in (("geoNameId", "-999"), ("gpsLatitude", "999"), ("gpsLongitude", "999")):
            ET.SubElement(location, tag).text = text
        ET.SubElement(ET.SubElement(root, "scenarioTags"), "simulated" if any(scene.tracks.driver) else "urban")
        free = self._network(root, scene)
        self._obstacles(root, scene, styles, name, free)
        ET.indent(root)
        ET.ElementTree(root).write(self._folder / f"{name}.xml", encoding="utf-8", xml_declaration=True)
        self.counts["written"] += 1

    def _network(self, root: ET.Element, scene: Scene) -> int:
        """Lanelets, signs and lights; the first number that is still free."""
        if scene.road is None:
            self.counts["scenarios_without_a_map"] += 1
            return 1
        origin, road = scene.tracks.origin_m, scene.road
        number = numbered(tuple(lane.lane_id for lane in road.lanes))
        free = max(number.values(), default=0) + 1
        limits = sorted({round(float(x.speed_limit_mps), 4) for x in road.lanes if math.isfinite(x.speed_limit_mps)})
        sign = {limit: free + i for i, limit in enumerate(limits)}
        free += len(sign)
        lights: dict[str, list[int]] = {}
        names = () if scene.signals is None else scene.signals.signal_id
        light = {name: free + i for i, name in enumerate(names)}
        free += len(light)
        if scene.signals is not None:
            for name, lanes in zip(names, scene.signals.lane_id, strict=True):
                for lane_id in lanes:
                    lights.setdefault(lane_id, []).append(light[name])
        before: dict[str, list[int]] = {}
        for lane in road.lanes:
            for following in lane.successors:
                before.setdefault(following, []).append(number[lane.lane_id])
        for lane in road.lanes:
            _lanelet(root, lane, number, before.get(lane.lane_id, []), sign, lights.get(lane.lane_id, []), origin)
        free = _intersection(root, road, number, free)
        self.counts["crosswalks_not_written"] += len(road.crosswalks_m)
        for limit, i in sign.items():
            element = ET.SubElement(root, "trafficSign", {"id": str(i)})
            found = ET.SubElement(element, "trafficSignElement")
            ET.SubElement(found, "trafficSignID").text = LIMIT_SIGN
            ET.SubElement(found, "additionalValue").text = repr(limit)
            ET.SubElement(element, "virtual").text = "true"
        if scene.signals is not None:
            for name, state in zip(names, scene.signals.state, strict=True):
                _light(root, light[name], state)
        return free

    def _obstacles(self, root: ET.Element, scene: Scene, styles: Styles, name: str, free: int) -> None:
        tracks = scene.tracks
        for i, agent in enumerate(tracks.agent_id):
            runs = _runs(tracks.valid[i])
            self.counts["obstacles_of_interrupted_tracks"] += max(0, len(runs) - 1)
            for start, stop in runs:
                if stop - start < 2:
                    self.counts["single_frames_not_written"] += 1
                    continue
                _obstacle(root, scene, i, start, stop, free)
                self._list(name, free, agent, styles)
                self.counts["agent_frames"] += stop - start
                free += 1

    def _list(self, name: str, number: int, agent: str, styles: Styles) -> None:
        if not self._ids:
            self._columns = sorted({key for found in styles.values() for key in found})
        found = styles.get(agent, {})
        row = [name, str(number), agent, *(str(found.get(column, "")) for column in self._columns)]
        self._ids.append(",".join(f'"{item}"' if "," in item else item for item in row))

    def finish(self) -> None:
        """Which obstacle is which road user, with the styles that were asked for."""
        head = ",".join(["benchmark_id", "obstacle_id", "agent_id", *self._columns])
        (self._folder / "ids.csv").write_text("\n".join([head, *self._ids, ""]), encoding="utf-8")


def _runs(valid: np.ndarray) -> list[tuple[int, int]]:
    edge = np.flatnonzero(np.diff(np.concatenate([[False], valid, [False]]).astype(np.int8)))
    return list(zip(edge[::2].tolist(), edge[1::2].tolist(), strict=True))


def _bound(parent: ET.Element, tag: str, line_m: np.ndarray) -> None:
    element = ET.SubElement(parent, tag)
    for x, y in line_m.tolist():
        point = ET.SubElement(element, "point")
        ET.SubElement(point, "x").text, ET.SubElement(point, "y").text = repr(x), repr(y)


def _lanelet(
    root: ET.Element,
    lane: Lane,
    number: dict[str, int],
    before: list[int],
    sign: dict[float, int],
    lights: list[int],
    origin_m: np.ndarray,
) -> None:
    element = ET.SubElement(root, "lanelet", {"id": str(number[lane.lane_id])})
    left, right = boundaries(lane)
    if len(left) != len(right):  # the format pairs their points
        n = max(len(left), len(right), 2)
        left, right = (_evenly(line, n) for line in (left, right))
    _bound(element, "leftBound", left + origin_m)
    _bound(element, "rightBound", right + origin_m)
    for ref in before:
        ET.SubElement(element, "predecessor", {"ref": str(ref)})
    for name in lane.successors:
        if name in number:
            ET.SubElement(element, "successor", {"ref": str(number[name])})
    for tag, name in (("adjacentLeft", lane.left_neighbour), ("adjacentRight", lane.right_neighbour)):
        if name in number:
            ET.SubElement(element, tag, {"ref": str(number[name]), "drivingDir": "same"})
    if lane.stop_line_m is not None:
        stop = ET.SubElement(element, "stopLine")
        for x, y in (lane.stop_line_m.astype(np.float64) + origin_m).tolist():
            point = ET.SubElement(stop, "point")
            ET.SubElement(point, "x").text, ET.SubElement(point, "y").text = repr(x), repr(y)
        ET.SubElement(stop, "lineMarking").text = "solid"
    ET.SubElement(element, "laneletType").text = "intersection" if lane.in_junction else "urban"
    if math.isfinite(lane.speed_limit_mps):
        ET.SubElement(element, "trafficSignRef", {"ref": str(sign[round(float(lane.speed_limit_mps), 4)])})
    for ref in lights:
        ET.SubElement(element, "trafficLightRef", {"ref": str(ref)})


def _intersection(root: ET.Element, road: Road, number: dict[str, int], free: int) -> int:
    """All lanes in junctions, as what the lanes before them lead to; the first number that is still free.

    Directions are not kept by a corpus: every way is written as straight on.
    """
    inside = {lane.lane_id for lane in road.lanes if lane.in_junction}
    before = [lane for lane in road.lanes if lane.lane_id not in inside and inside & set(lane.successors)]
    if not before:
        return free
    element = ET.SubElement(root, "intersection", {"id": str(free)})
    for k, lane in enumerate(before, start=1):
        incoming = ET.SubElement(element, "incoming", {"id": str(free + k)})
        ET.SubElement(incoming, "incomingLanelet", {"ref": str(number[lane.lane_id])})
        for name in lane.successors:
            if name in inside:
                ET.SubElement(incoming, "successorsStraight", {"ref": str(number[name])})
    return free + len(before) + 1


def _evenly(line_m: np.ndarray, n: int) -> np.ndarray:
    """`n` points at equal distances."""
    fine = resampled(line_m, 0.1)
    return fine[np.linspace(0, len(fine) - 1, n).round().astype(int)]


def _light(root: ET.Element, number: int, state: np.ndarray) -> None:
    """The states that were seen, one after the other, as a cycle."""
    element = ET.SubElement(root, "trafficLight", {"id": str(number)})
    cycle = ET.SubElement(element, "cycle")
    change = np.flatnonzero(np.diff(state)) + 1
    for start, stop in zip([0, *change.tolist()], [*change.tolist(), len(state)], strict=True):
        found = ET.SubElement(cycle, "cycleElement")
        ET.SubElement(found, "duration").text = str(stop - start)
        ET.SubElement(found, "color").text = COLOURS[SignalState(int(state[start]))]
    ET.SubElement(cycle, "timeOffset").text = "0"
    ET.SubElement(element, "direction").text = "all"
    ET.SubElement(element, "active").text = "true"


def _obstacle(root: ET.Element, scene: Scene, i: int, start: int, stop: int, number: int) -> None:
    tracks = scene.tracks
    element = ET.SubElement(root, "dynamicObstacle", {"id": str(number)})
    ET.SubElement(element, "type").text = TYPES[AgentKind(int(tracks.kind[i]))]
    rectangle = ET.SubElement(ET.SubElement(element, "shape"), "rectangle")
    length, width = np.maximum(np.nan_to_num(tracks.size_m[i].astype(np.float64)), LEAST_SIZE_M).tolist()
    ET.SubElement(rectangle, "length").text, ET.SubElement(rectangle, "width").text = repr(length), repr(width)
    place = tracks.position_m[i].astype(np.float64) + tracks.origin_m
    turn = tracks.heading_rad[i].astype(np.float64)
    v = tracks.velocity_mps[i].astype(np.float64)
    along = np.cos(turn) * v[:, 0] + np.sin(turn) * v[:, 1]
    trajectory: ET.Element | None = None
    for t in range(start, stop):
        if t == start:
            state = ET.SubElement(element, "initialState")
        else:
            if trajectory is None:
                trajectory = ET.SubElement(element, "trajectory")
            state = ET.SubElement(trajectory, "state")
        point = ET.SubElement(ET.SubElement(state, "position"), "point")
        ET.SubElement(point, "x").text, ET.SubElement(point, "y").text = (
            repr(float(place[t, 0])),
            repr(float(place[t, 1])),
        )
        for tag, number_ in (("orientation", float(turn[t])), ("time", t), ("velocity", float(along[t]))):
            ET.SubElement(ET.SubElement(state, tag), "exact").text = repr(number_)
