"""GPUDrive and Nocturne JSON: Waymo Open Motion scenarios as these simulators read them.

One file is one scenario of 91 frames at 10 Hz. Sizes are one per object, headings in radians (GPUDrive) or degrees
(Nocturne), lanes are bare polylines without topology, speed limits or boundaries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.datasets.accounting import row_counts
from stylesim.datasets.dense import checked_tracks, origin_of
from stylesim.datasets.guarding import mapping, mappings, reading
from stylesim.datasets.json_files import json_document
from stylesim.datasets.light_states import light_state
from stylesim.datasets.polyline_map import PolylineLane, PolylineMap, road_of
from stylesim.datasets.sniffing import head, listed, matching
from stylesim.datasets.womd import split_of
from stylesim.datasets.womd_scenario import DT_S, signals_of
from stylesim.errors import InputError
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.signals import Signals, SignalState
from stylesim.tracks import AgentKind, TrackFlag

SOURCE = "gpudrive"
T0_FRAME = 10  # of the data set that these files are made of
MAX_FILE_BYTES = 1 << 28  # chosen: files have 1 to 10 MB
KINDS = {"vehicle": AgentKind.CAR, "pedestrian": AgentKind.PEDESTRIAN, "cyclist": AgentKind.BICYCLE}
LANES = ("lane", "freeway", "surface_street")  # "bike_lane" is left out
_NOT_SCENARIOS = ("valid_files.json", "invalid_files.json")  # lists of names that Nocturne keeps beside them


def scenes(path: str | Path) -> Iterator[Scene]:
    """The scenarios of a JSON file, or of every one in a folder, by name. InputError names what is damaged."""
    for file in files(path):
        with reading(file, "scenario of GPUDrive or Nocturne"):
            scene = _scene(json_document(file, limit_bytes=MAX_FILE_BYTES), file)
        yield scene


def files(path: str | Path) -> list[Path]:
    """The JSON files, each of which can be read alone; InputError where there is none."""
    found = _files(Path(path), listed)
    if not found:
        raise InputError(f"{path} holds no JSON file of GPUDrive or Nocturne")
    return found


def sniff(path: Path) -> bool:
    """True for a JSON file that begins as such a scenario does, or a folder with one."""
    found = _files(path, matching)
    start = head(found[0], 300) if found else b""
    return start.startswith(b"{") and (b'"objects": [' in start or b'"objects":[' in start)


def _files(path: Path, find: Callable[..., list[Path]]) -> list[Path]:
    found = [path] if path.is_file() else find(path, "*.json")
    return [file for file in found if file.name not in _NOT_SCENARIOS and file.suffix == ".json"]


def _scene(document: Mapping[str, Any], file: Path) -> Scene:
    objects = document["objects"]
    meta = document.get("metadata") or {}
    n_frames = max(len(o["position"]) for o in objects)
    position = np.array([[[p["x"], p["y"]] for p in o["position"]] for o in objects], np.float64)
    velocity = np.array([[[v["x"], v["y"]] for v in o["velocity"]] for o in objects], np.float64)
    heading = np.array([o["heading"] for o in objects], np.float64)
    valid = np.array([o["valid"] for o in objects])
    if valid.dtype != bool or not valid.shape == heading.shape == (len(objects), n_frames):
        raise ValueError("position, heading and valid differ in length")
    if np.abs(heading[valid]).max(initial=0.0) > 2 * np.pi + 0.01:
        heading = np.radians(heading)  # Nocturne's own files are in degrees; a mixture is refused by its motion
    scenario_id = str(document.get("scenario_id") or document.get("name") or file.stem)
    origin = origin_of(position, valid)
    tracks, dropped = checked_tracks(
        agent_id=_ids(objects),
        kind=np.array([int(KINDS.get(o["type"], AgentKind.OTHER)) for o in objects]),
        size_m=np.array([[o["length"], o["width"]] for o in objects], np.float64),
        position_m=position,
        velocity_mps=velocity,
        heading_rad=heading,
        valid=valid,
        dt_s=DT_S,
        origin_m=origin,
        file=file,
        flags=_flags(meta, len(objects)),
    )
    signals, stops = _signals(mapping(document.get("tl_states") or {}, "tl_states"), n_frames)
    return Scene(
        scene_id=f"gpudrive_{scenario_id}",
        unit_id=f"womd_{scenario_id}",  # the same drive as in the original, also in splits
        source=SOURCE,
        scenario="womd",
        tracks=tracks,
        road=_road(mappings(document.get("roads") or [], "roads"), stops, origin),
        signals=signals,
        source_scenario_id=scenario_id,
        official_split=split_of(file.name),
        t0_frame=T0_FRAME if n_frames > T0_FRAME else None,
        counts=row_counts(rows_in=int(valid.sum()), rows_out=int(tracks.valid.sum()), dropped=dropped),
    )


def _ids(objects: list[Mapping[str, Any]]) -> list[str]:
    ids = [str(o["id"]) if "id" in o else f"object_{i}" for i, o in enumerate(objects)]
    if len(set(ids)) != len(ids):
        raise ValueError("two objects have one id")
    return ids


def _flags(meta: Mapping[str, Any], n: int) -> np.ndarray:
    flags = np.zeros(n, np.int32)
    ego = meta.get("sdc_track_index")
    if ego is not None and 0 <= int(ego) < n:
        flags[int(ego)] |= int(TrackFlag.EGO)
    for entry in meta.get("tracks_to_predict") or []:
        index = int(entry["track_index"])
        if not 0 <= index < n:
            raise ValueError(f"the track to predict {index} is not there")
        flags[index] |= int(TrackFlag.FOCAL)
    return flags


def _signals(lights: Mapping[str, Any], n_frames: int) -> tuple[Signals | None, dict[str, Any]]:
    shown: dict[str, np.ndarray] = {}
    stops: dict[str, Any] = {}
    for key, light in lights.items():
        lane = str(key)
        shown[lane] = np.full(n_frames, int(SignalState.UNKNOWN), np.int8)
        for frame, state in zip(light["time_index"], light["state"], strict=True):
            if not 0 <= int(frame) < n_frames:
                raise ValueError(f"the light {lane} has a state in frame {frame} of {n_frames}")
            shown[lane][int(frame)] = int(light_state(state))
        if light.get("x"):
            stops[lane] = (light["x"][0], light["y"][0])
    return signals_of(shown), stops


def _road(roads: list[Mapping[str, Any]], stops: dict[str, Any], origin_m: np.ndarray) -> Road | None:
    result = PolylineMap(stops=stops)
    for i, road in enumerate(roads):
        line = (
            [(p["x"], p["y"], p.get("z", 0.0)) for p in road["geometry"]] if isinstance(road["geometry"], list) else []
        )
        if road["type"] in LANES and line:
            result.lanes.append(PolylineLane(lane_id=str(road.get("id", f"road_{i}")), points=line))
        elif road["type"] == "crosswalk" and line:
            result.crosswalks.append(line)
    if len({lane.lane_id for lane in result.lanes}) != len(result.lanes):
        raise ValueError("two lanes have one id")
    return road_of(result, origin_m, link_ends=True) if result.lanes else None
