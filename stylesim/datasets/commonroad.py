"""CommonRoad scenarios (XML, versions 2018b and 2020a): obstacles, lanelets, cycles of lights.

One file is one scene, never cut. All cuts of one site are one unit: names such as `USA_US101-3_4_T-1` say the site
(US101), not from which stretch of its recording a cut is. The vehicle to be planned is not a road user that was
recorded and is left out. Lights are the file's fixed cycles, which nobody says were those of the day.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import polars as pl

from stylesim.collecting import no_collection
from stylesim.datasets.commonroad_map import points, read_road
from stylesim.datasets.commonroad_states import State, without_trajectories
from stylesim.datasets.cutting import cut
from stylesim.datasets.guarding import reading
from stylesim.datasets.maps.site_map import SiteMap
from stylesim.datasets.recording import SignalLog
from stylesim.datasets.resampling import on_clock
from stylesim.datasets.sniffing import matching
from stylesim.datasets.track_table import Source, recording_of
from stylesim.errors import InputError
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind
from stylesim.xmlfiles import root_name, tree, unchecked_bytes

SOURCE = "commonroad"
VERSIONS = ("2018b", "2020a")
MAX_STEPS = 100_000  # chosen: at 0.1 s almost three hours; a longer scenario is damaged
KINDS = {
    "car": AgentKind.CAR,
    "taxi": AgentKind.CAR,
    "priorityVehicle": AgentKind.CAR,
    "parkedVehicle": AgentKind.CAR,
    "truck": AgentKind.TRUCK,
    "bus": AgentKind.BUS,
    "motorcycle": AgentKind.MOTORCYCLE,
    "bicycle": AgentKind.BICYCLE,
    "pedestrian": AgentKind.PEDESTRIAN,
    "constructionZone": AgentKind.STATIC,
    "roadBoundary": AgentKind.STATIC,
    "building": AgentKind.STATIC,
    "pillar": AgentKind.STATIC,
    "median_strip": AgentKind.STATIC,
}
COLOURS = {
    "green": SignalState.GREEN,
    "yellow": SignalState.YELLOW,
    "red": SignalState.RED,
    "redYellow": SignalState.RED,
    "inactive": SignalState.DARK,
}
_NAME = re.compile(r"^(?:C-)?([A-Z]{3}_[A-Za-z0-9]+)-\d")


def scenes(path: str | Path) -> Iterator[Scene]:
    """The scenario of a file, or those of a folder and of the folders below, by name.

    InputError names the file that is missing, damaged, of another version, or in other units.
    """
    root = Path(path)
    if not root.exists():
        raise InputError(f"{root} does not exist; give a scenario's XML file, or a folder of them")
    files = [root] if root.is_file() else [f for f in sorted(root.rglob("*.xml")) if root_name(f) == "commonRoad"]
    if not files:
        raise InputError(f"{root} holds no CommonRoad scenario (XML with the root <commonRoad>)")
    seen: dict[str, Path] = {}
    for file in files:
        for scene in _scenes(file):
            if scene.scene_id in seen:
                raise InputError(f"{file} and {seen[scene.scene_id]} are both the scenario {scene.source_scenario_id}")
            seen[scene.scene_id] = file
            yield scene


def sniff(path: Path) -> bool:
    """True for a scenario, or a folder with one in it or one level below."""
    return any(root_name(file) == "commonRoad" for file in matching(path, "*.xml", "*/*.xml")[:20])


def _scenes(file: Path) -> Iterator[Scene]:
    with reading(file, "scenario of CommonRoad"), no_collection():
        raw, trajectories = without_trajectories(unchecked_bytes(file))
    root = tree(raw, file, root="commonRoad")
    version = root.get("commonRoadVersion", "")
    if version not in VERSIONS:
        raise InputError(f"{file} is of version {version!r:.40}; read are {' and '.join(VERSIONS)}")
    with reading(file, "scenario of CommonRoad"):
        dt_s = float(root.get("timeStepSize", "nan"))
        if not 0.005 <= dt_s <= 2.0:
            raise InputError(f"{file}: timeStepSize is {root.get('timeStepSize')!r}; expected seconds, 0.005 to 2")
        name = (root.get("benchmarkID") or file.stem)[:200]
        with no_collection():
            table, dropped = _table(root, file, trajectories)
        recording, origin = recording_of(table, Source(file, f"{SOURCE}_{name}", dt_s, dropped))
        site = read_road(root, origin)
        log = _lights(root, site, int(recording.frame.max(initial=0)) + 1, dt_s)
    match = _NAME.match(name)
    place = match.group(1) if match else name
    whole = on_clock(replace(recording, signals=log, notes={**recording.notes, **(site.notes if site else {})}))
    yield from cut(
        whole,
        source=SOURCE,
        scenario=place,
        unit_id=f"{SOURCE}_{place}",
        origin_m=origin,
        road=None if site is None else site.road,
        scene_s=(int(whole.frame.max(initial=0)) + 2) * whole.dt_s,
    )


def _table(root: Element, file: Path, trajectories: list[list[State]]) -> tuple[pl.DataFrame, dict[str, int]]:
    """One row per state of an obstacle; a static obstacle's one state holds in every frame."""
    rows: list[tuple[str, int, float, float, float, float, float, float, int]] = []
    still: list[tuple[str, float, float, float, float, float, int]] = []
    uncertain = 0
    for tag in ("dynamicObstacle", "obstacle", "staticObstacle"):
        for obstacle in root.findall(tag):
            agent = obstacle.get("id", "")
            kind = int(KINDS.get(obstacle.findtext("type", ""), AgentKind.OTHER))
            length, width, dx, dy, turn = _shape(obstacle.find("shape"))
            fixed = tag == "staticObstacle" or obstacle.findtext("role", "dynamic") == "static"
            states = _states(obstacle, trajectories)
            for read in states[:1] if fixed else states:
                if read is None:
                    uncertain += 1  # an area or an interval where a place is needed
                    continue
                step, x, y, heading, speed = read
                if (dx or dy) and math.isfinite(heading):  # else the row is unreadable, and counted as such
                    x += dx * math.cos(heading) - dy * math.sin(heading)
                    y += dx * math.sin(heading) + dy * math.cos(heading)
                if fixed:
                    still.append((agent, x, y, heading + turn, length, width, kind))
                else:
                    rows.append((agent, step, x, y, heading + turn, speed, length, width, kind))
    steps = {row[1] for row in rows}
    last = max(steps, default=0)
    if last > MAX_STEPS or min(steps, default=0) < 0:
        raise InputError(f"{file} has a state at step {last}; expected 0 to {MAX_STEPS}")
    for agent, x, y, heading, length, width, kind in still:
        rows += [(agent, step, x, y, heading, 0.0, length, width, kind) for step in range(last + 1)]
    if not rows:
        raise InputError(f"{file} has no obstacle with a state at an exact place; there is nothing to read")
    schema = {
        "agent": pl.String, "frame": pl.Int64, "x": pl.Float64, "y": pl.Float64, "heading": pl.Float64,
        "speed": pl.Float64, "length": pl.Float64, "width": pl.Float64, "kind": pl.Int8,
    }  # fmt: skip
    return pl.DataFrame(rows, schema=schema, orient="row"), {"inexact": uncertain}


def _shape(shape: Element | None) -> tuple[float, float, float, float, float]:
    """Length, width, and where the shape's centre lies and how it is turned in the obstacle's frame."""
    if shape is None:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    rectangle, circle, polygon = shape.find("rectangle"), shape.find("circle"), shape.find("polygon")
    found = rectangle if rectangle is not None else circle
    if found is not None:
        dx, dy = float(found.findtext("center/x", "0")), float(found.findtext("center/y", "0"))
        if circle is not None and rectangle is None:
            diameter = 2 * float(circle.findtext("radius", "nan"))
            return diameter, diameter, dx, dy, 0.0
        turn = float(found.findtext("orientation", "0"))
        return float(found.findtext("length", "nan")), float(found.findtext("width", "nan")), dx, dy, turn
    corners = points(polygon) if polygon is not None else np.zeros((0, 2))
    if len(corners) < 3:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    low, high = corners.min(axis=0), corners.max(axis=0)
    return float(high[0] - low[0]), float(high[1] - low[1]), *((low + high) / 2).tolist(), 0.0


def _states(obstacle: Element, trajectories: list[list[State]]) -> list[State | None]:
    """All states of an obstacle in the order of the file; None for one that is not exact."""
    found = [_state(state) for state in obstacle.findall("initialState")]
    for trajectory in obstacle.findall("trajectory"):
        number = trajectory.get("states")
        found += [_state(s) for s in trajectory.findall("state")] if number is None else trajectories[int(number)]
    return found


def _state(state: Element) -> State | None:
    """Step, place, orientation and speed; None where one of the first three is not exact."""
    time, heading = state.findtext("time/exact"), state.findtext("orientation/exact")
    x, y = state.findtext("position/point/x"), state.findtext("position/point/y")
    if None in (time, heading, x, y):
        return None
    step = float(time or "nan")
    if step != round(step):
        return None
    speed = state.findtext("velocity/exact") or "0"
    return int(step), float(x or "nan"), float(y or "nan"), float(heading or "nan"), float(speed)


def _lights(root: Element, site: SiteMap | None, n_steps: int, dt_s: float) -> SignalLog | None:
    """What each light's cycle shows at every step; None without lights."""
    shown, names = [], []
    steps = np.arange(n_steps)
    for light in root.findall("trafficLight"):
        cycle = light.find("cycle")
        elements = [] if cycle is None else cycle.findall("cycleElement")
        durations = np.array([int(e.findtext("duration", "0")) for e in elements])
        names.append(light.get("id", ""))
        if light.findtext("active", "true") == "false" or not len(durations) or durations.min() <= 0:
            shown.append(np.full(n_steps, int(SignalState.UNKNOWN), np.int8))
            continue
        offset = 0 if cycle is None else int(cycle.findtext("timeOffset", "0"))
        phase = np.searchsorted(np.cumsum(durations), (steps - offset) % int(durations.sum()), side="right")
        colours = [int(COLOURS.get(e.findtext("color", ""), SignalState.UNKNOWN)) for e in elements]
        shown.append(np.array(colours, np.int8)[phase])
    if not names:
        return None
    if len(set(names)) != len(names):
        raise ValueError("two traffic lights have the same id")
    links = () if site is None else site.light_lanes(names)
    return SignalLog(steps * dt_s, tuple(names), np.stack(shown), stale_s=1.5 * dt_s, lane_id=links)
