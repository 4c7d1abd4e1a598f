"""Map features and light states of a ScenarioNet scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stylesim.datasets.boundaries import Stretch
from stylesim.datasets.guarding import mapping
from stylesim.datasets.light_states import light_state
from stylesim.datasets.polyline_map import MPH, PolylineLane, PolylineMap
from stylesim.signals import Signals

LANES = ("LANE_SURFACE_STREET", "LANE_FREEWAY")  # not LANE_BIKE_LANE, nor areas without a centre line
BOUNDARIES = ("ROAD_LINE", "ROAD_EDGE")


def map_of(features: Mapping[str, Any], *, limits: bool = True) -> PolylineMap:
    """Lanes for motor traffic, lines and crosswalks, in the source's frame.

    `limits=False` leaves speed limits out: for nuScenes, whose maps have none, ScenarioNet writes 100 km/h everywhere.
    """
    result = PolylineMap()
    for key, feature in features.items():
        kind = str(feature["type"])
        if kind in LANES and "polyline" in feature:
            if len(feature["polyline"]):
                result.lanes.append(_lane(str(key), mapping(feature, "a lane"), limits))
        elif kind.startswith(BOUNDARIES):
            if len(feature["polyline"]) >= 2:
                result.lines[str(key)] = feature["polyline"]
        elif kind == "CROSSWALK" and len(feature["polygon"]) >= 3:
            result.crosswalks.append(feature["polygon"])
    return result


def _lane(lane_id: str, feature: Mapping[str, Any], limits: bool) -> PolylineLane:
    mph, kmh = feature.get("speed_limit_mph"), feature.get("speed_limit_kmh")
    limit = float(mph) * MPH if mph is not None else float(kmh) / 3.6 if kmh is not None else float("nan")
    limit = limit if limits else float("nan")
    boundary = ("boundary_feature_id", "lane_start_index", "lane_end_index")
    neighbour = ("feature_id", "self_start_index", "self_end_index")
    return PolylineLane(
        lane_id=lane_id,
        points=np.asarray(feature["polyline"], np.float64)[:, :2],  # a third column is a height or a heading
        speed_limit_mps=limit,
        successors=[str(i) for i in feature.get("exit_lanes") or ()],
        left_boundaries=_stretches(feature.get("left_boundaries"), boundary),
        right_boundaries=_stretches(feature.get("right_boundaries"), boundary),
        left_neighbours=_stretches(feature.get("left_neighbor"), neighbour),
        right_neighbours=_stretches(feature.get("right_neighbor"), neighbour),
        in_junction=bool(feature.get("interpolating", False)),
    )


def _stretches(entries: Any, keys: Sequence[str]) -> list[Stretch]:
    """Entries that say from where to where; bare ids (as some converters write) hold for the whole lane."""
    found: list[Stretch] = []
    for entry in entries or ():
        if isinstance(entry, Mapping):
            found.append((str(entry[keys[0]]), int(entry[keys[1]]), int(entry[keys[2]])))
        else:
            found.append((str(entry), 0, 1 << 30))
    return found


def signals_of(states: Mapping[str, Any], n_frames: int, features: PolylineMap) -> Signals | None:
    """One light per controlled lane; its stop point goes to `features.stops`. Names and numbers of states are read."""
    names, lanes, rows = [], [], []
    for key, light in states.items():
        if not isinstance(light.get("state"), Mapping) or "object_state" not in light["state"]:
            raise ValueError("lights of the old form, without state/object_state; convert the data set again")
        shown = list(light["state"]["object_state"])
        if len(shown) != n_frames:
            raise ValueError(f"the light {key} has {len(shown)} states for {n_frames} frames")
        known = {value: int(light_state(value)) for value in {_hashable(v) for v in shown}}
        lane = str(light.get("lane", key))
        names.append(str(key))
        lanes.append((lane,) if light.get("lane") is not None else ())
        rows.append(np.array([known[_hashable(v)] for v in shown], np.int8))
        if light.get("stop_point") is not None:
            stop = np.asarray(light["stop_point"], np.float64).reshape(-1, np.shape(light["stop_point"])[-1])
            features.stops[lane] = stop[0][:2]
    if not names:
        return None
    return Signals(signal_id=tuple(names), lane_id=tuple(lanes), state=np.stack(rows))


def _hashable(value: Any) -> Any:
    return value if isinstance(value, str) or value is None else float(value)
