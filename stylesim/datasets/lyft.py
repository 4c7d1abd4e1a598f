"""Lyft Level 5 prediction: 25 s scenes at 10 Hz, as zarr (version 2) with scenes, frames and agents.

One of its scenes is one scene, never recut; scenes of one vehicle that follow one another within a minute are one
recording. Faces of traffic lights are logged as on or off, their colours and lanes are in the semantic map (a download
of its own, see `lyft_map`): the one that is given, or `semantic_map/semantic_map.pb` beside the store or above it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.datasets.accounting import row_counts
from stylesim.datasets.clocks import frames_of
from stylesim.datasets.dense import checked_tracks, origin_of, size_when_seen
from stylesim.datasets.differences import causal_velocity
from stylesim.datasets.guarding import bounded, reading
from stylesim.datasets.lyft_lights import FACE, lights_of
from stylesim.datasets.lyft_map import LyftMap, lyft_map
from stylesim.datasets.lyft_records import AGENT, FRAME, SCENE, labels_of
from stylesim.datasets.sniffing import listed, matching
from stylesim.datasets.zarr_files import RecordArray
from stylesim.errors import InputError
from stylesim.scene import Scene
from stylesim.tracks import AgentKind, TrackFlag

SOURCE = "lyft"
DT_S = 0.1
EGO = "ego"
EGO_SIZE_M = (4.87, 1.85)  # l5kit.data: EGO_EXTENT_LENGTH, EGO_EXTENT_WIDTH; the pose is taken as the box's centre
POSE_STRIDE = 2  # frames; chosen: differences over 0.2 s instead of 0.1 s halve the noise of the ego's velocity
# Chosen, as for DLR Urban Traffic: scenes that join within a minute are one continuous recording.
JOINED_WITHIN_S = 60.0
SCENE_S = 25.0  # the length of its scenes
MAPS_ABOVE = 3  # scenes/<name>.zarr, semantic_map/semantic_map.pb, meta.json is the layout that is published
MAX_FRAMES = 100_000  # chosen: a scene has about 250 frames


def scenes(path: str | Path, *, map: str = "") -> Iterator[Scene]:
    """The scenes of a zarr folder, or of every one in a folder, in the file's order.

    `map` is a semantic_map.pb, or "none". InputError names the file, array or chunk that is missing or damaged;
    MissingDependencyError without numcodecs.
    """
    for store in files(path):
        where = map_of(store, map)
        site = None if where is None else _site(where, where.stat().st_mtime_ns)
        with reading(store, "zarr folder of Lyft"):
            faces = None if site is None else RecordArray(store / "traffic_light_faces", FACE)
            arrays = tuple(
                RecordArray(store / n, d) for n, d in (("scenes", SCENE), ("frames", FRAME), ("agents", AGENT))
            )
            kinds = labels_of(store)
        unit, begin = "", 0
        ended: dict[str, int] = {}
        for number in range(arrays[0].length):
            with reading(store, "zarr folder of Lyft"):
                record = arrays[0].rows(number, number + 1)[0]
                host, start, end = str(record["host"]), int(record["start_time"]), int(record["end_time"])
                if not host or not 0 < start <= end:
                    raise InputError(f"{store}: scene {number} has no host or times")
                if not 0 <= start - ended.get(host, -(10**18)) <= JOINED_WITHIN_S * 1e9:
                    unit, begin = f"lyft_{host}_{start}", start
                ended = {host: end}
                scene = _scene(store, number, record, arrays, kinds, unit, (start - begin) / 1e9)
                if site is not None and faces is not None:
                    scene = _on_map(scene, record, arrays[1], faces, site, store, first=number == 0)
            yield scene


def files(path: str | Path) -> list[Path]:
    """The zarr folders, each of which can be read alone; InputError where there is none."""
    found = _stores(Path(path), listed)
    if not found:
        raise InputError(f"{path} is no zarr folder of Lyft with scenes, frames and agents, and holds none")
    return found


def sniff(path: Path) -> bool:
    """True for a zarr folder with Lyft's arrays, or a folder with one."""
    return bool(_stores(path, matching))


def _stores(path: Path, find: Callable[..., list[Path]]) -> list[Path]:
    found = [path, *find(path, "*.zarr", "*/*.zarr")] if path.is_dir() else []
    needed = ("scenes", "frames", "agents")
    return [store for store in found if all((store / name / ".zarray").is_file() for name in needed)]


@lru_cache(maxsize=1)
def _site(file: Path, changed_ns: int) -> LyftMap:
    return lyft_map(file)


def map_of(store: Path, given: str) -> Path | None:
    """The given map, or the nearest `semantic_map/semantic_map.pb`; None where there is none, or "none" is given."""
    if given:
        return None if given == "none" else bounded(Path(given))
    found = (folder / "semantic_map" / "semantic_map.pb" for folder in store.resolve().parents[:MAPS_ABOVE])
    return next((file for file in found if file.is_file()), None)


def _on_map(
    scene: Scene, record: Any, frames: RecordArray, faces: RecordArray, site: LyftMap, store: Path, *, first: bool
) -> Scene:
    """The scene with the lanes around it and what their lights show; lanes without line are counted in the first."""
    rows = frames.rows(*(int(i) for i in record["frame_index_interval"]))
    clock = frames_of((rows["timestamp"] - rows["timestamp"][0]) / 1e9, DT_S, store)
    bounds = rows["traffic_light_faces_index_interval"].astype(np.int64)
    if (bounds[:, 1] < bounds[:, 0]).any() or (bounds[1:, 0] != bounds[:-1, 1]).any():
        raise InputError(f"{store}: the faces of lights of scene {scene.source_scenario_id} are not in one piece")
    road = site.city.around(scene.tracks, SCENE_S)
    signals = None
    if road is not None:
        logged = faces.rows(int(bounds[0, 0]), int(bounds[-1, 1]))
        frame = np.repeat(clock, bounds[:, 1] - bounds[:, 0])
        signals = lights_of(logged, frame, int(clock[-1]) + 1, site, [lane.lane_id for lane in road.lanes])
    incomplete = {"map_lanes_incomplete": site.city.incomplete} if first and site.city.incomplete else {}
    return replace(scene, road=road, signals=signals, counts={**scene.counts, **incomplete})


def _scene(
    store: Path,
    number: int,
    record: Any,
    arrays: tuple[RecordArray, ...],
    kinds: list[AgentKind],
    unit_id: str,
    start_s: float,
) -> Scene:
    first, last = (int(i) for i in record["frame_index_interval"])
    if not 0 < last - first <= MAX_FRAMES:
        raise InputError(f"{store}: scene {number} has the frames {first} to {last}")
    frames = arrays[1].rows(first, last)
    bounds = frames["agent_index_interval"].astype(np.int64)
    if (bounds[:, 1] < bounds[:, 0]).any() or (bounds[1:, 0] != bounds[:-1, 1]).any():
        raise InputError(f"{store}: the agents of scene {number} are not in one piece")
    agents = arrays[2].rows(int(bounds[0, 0]), int(bounds[-1, 1]))
    time_s = (frames["timestamp"] - frames["timestamp"][0]) / 1e9
    clock = frames_of(time_s, DT_S, store)
    ids, agent = np.unique(agents["track_id"], return_inverse=True)
    at = (agent + 1, np.repeat(clock, bounds[:, 1] - bounds[:, 0]))  # row 0 is the ego vehicle
    shape = (len(ids) + 1, int(clock[-1]) + 1)
    valid = np.zeros(shape, bool)
    duplicates = len(agents) - len(np.unique(at[0] * shape[1] + at[1]))
    position, velocity, size = (np.full((*shape, 2), np.nan) for _ in range(3))
    heading = np.full(shape, np.nan)
    order = tuple(index[::-1] for index in at)  # of two rows for one agent and frame the first is kept
    for target, column in ((position, "centroid"), (velocity, "velocity"), (heading, "yaw")):
        target[order] = agents[column][::-1]
    size[order] = agents["extent"][::-1, :2]
    valid[order] = True
    valid[0, clock] = True
    position[0, clock], size[0] = frames["ego_translation"][:, :2], EGO_SIZE_M
    heading[0, clock] = np.arctan2(frames["ego_rotation"][:, 1, 0], frames["ego_rotation"][:, 0, 0])
    velocity[:1], ahead = causal_velocity(position[:1], valid[:1], np.arange(shape[1]) * DT_S, POSE_STRIDE)
    lookahead = np.zeros(shape, np.int64)
    lookahead[0] = ahead[0]
    flags = np.zeros(shape[0], np.int32)
    flags[0] = int(TrackFlag.EGO)
    seen_first = np.full(shape[0], -1)
    seen_first[order[0]] = np.arange(len(agents))[::-1]
    label = agents["label_probabilities"].argmax(axis=1)
    origin = origin_of(position, valid)
    tracks, dropped = checked_tracks(
        agent_id=[EGO, *(str(i) for i in ids)],
        kind=np.array([int(AgentKind.CAR), *(int(kinds[label[i]]) for i in seen_first[1:])]),
        size_m=size_when_seen(size, valid, 0),
        position_m=position,
        velocity_mps=velocity,
        heading_rad=heading,
        valid=valid,
        dt_s=DT_S,
        origin_m=origin,
        file=store,
        flags=flags,
        lookahead_steps=lookahead,
    )
    name = f"lyft_{record['host']}_{int(record['start_time'])}"
    return Scene(
        scene_id=name,
        unit_id=unit_id,
        source=SOURCE,
        scenario="palo_alto",
        tracks=tracks,
        start_s=start_s,
        source_scenario_id=str(number),
        official_split={"train": "train", "validate": "val", "test": "test"}.get(store.stem, ""),
        counts=row_counts(
            rows_in=len(agents) + len(frames),
            rows_out=int(tracks.valid.sum()),
            dropped={"duplicate": duplicates, **dropped},
        ),
    )
