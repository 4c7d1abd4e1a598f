"""nuScenes: 20 s scenes with boxes at 2 Hz (key frames), as relational JSON tables, with the map expansion.

One scene is one scene at its own rate: 0.5 s from frame to frame, nothing between key frames is made up (`merge`
brings it to 0.1 s and marks what lies between). Scenes of one log are one unit. Key frames come up to some 0.1 s
early or late; every place is moved along its own velocity to the frame's time. There are no velocities: they are
made from the key frames seen so far (see `differences`). The test split has no boxes: only the ego vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stylesim.datasets.accounting import added, row_counts
from stylesim.datasets.clocks import frames_of
from stylesim.datasets.dense import checked_tracks, size_when_seen
from stylesim.datasets.differences import causal_velocity
from stylesim.datasets.grids import Grid, grid_of
from stylesim.datasets.guarding import reading
from stylesim.datasets.nuscenes_kinds import EGO_AXLE_TO_CENTRE_M, EGO_SIZE_M, kind_of
from stylesim.datasets.nuscenes_map import read_map
from stylesim.datasets.nuscenes_tables import SceneRecord, Tables, tables_of
from stylesim.datasets.rotations import heading_of, rotation_of
from stylesim.datasets.sniffing import matching
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.tracks import AgentKind, TrackFlag

SOURCE = "nuscenes"
DT_S = 0.5
EGO = "ego"
ORIGIN_M = np.zeros(2)  # maps are a few kilometres wide and begin at 0: one road serves all scenes of a place
MAX_OFF_S = 0.25  # half a frame; chosen: a key frame farther from the clock belongs to the next frame


def scenes(path: str | Path) -> Iterator[Scene]:
    """The scenes of a version's folder (v1.0-mini, …), or of every version in the data set's root, by time.

    InputError names the table that is missing or damaged.
    """
    folders = _versions(Path(path))
    if not folders:
        raise InputError(f"{path} holds no version of nuScenes (a folder with scene.json and sample_annotation.json)")
    for folder in folders:
        tables = tables_of(folder)
        roads: dict[str, Road | None] = {}
        orphans = tables.orphans
        begun: dict[str, float] = {}
        for record in _in_time(tables):
            if record.location not in roads:
                roads = {record.location: _road(folder.parent, record.location)}  # one at a time in memory
            with reading(folder, f"scene {record.name} of nuScenes"):
                begin = begun.setdefault(record.logfile, float(tables.time_us[record.samples[0]]))
                scene = _scene(folder, tables, record, roads[record.location], orphans, begin)
            yield scene
            orphans = 0


def _in_time(tables: Tables) -> list[SceneRecord]:
    return sorted(tables.scenes, key=lambda s: (s.location, s.logfile, tables.time_us[s.samples[0]]))


def sniff(path: Path) -> bool:
    """True for a version's folder, or a root with one."""
    return bool(_versions(path))


def _versions(path: Path) -> list[Path]:
    files = matching(path, "sample_annotation.json", "*/sample_annotation.json") if path.is_dir() else []
    return [file.parent for file in files if (file.parent / "scene.json").is_file()]


def _road(root: Path, location: str) -> Road | None:
    file = root / "maps" / "expansion" / f"{location}.json"
    if not file.resolve().is_relative_to((root / "maps").resolve()):
        raise InputError(f"the location {location!r} leads out of {root}")
    return read_map(file) if file.is_file() else None


def _scene(
    folder: Path, tables: Tables, record: SceneRecord, road: Road | None, orphans: int, log_begin_us: float
) -> Scene:
    samples = np.array(record.samples)
    time_s = (tables.time_us[samples] - tables.time_us[samples[0]]) / 1e6
    clock = frames_of(time_s, DT_S, folder)
    late_s = time_s - clock * DT_S
    if np.abs(late_s).max() > MAX_OFF_S:
        raise InputError(f"{folder}: key frames of {record.name} are up to {np.abs(late_s).max():.2f} s off 2 Hz")
    grid = _grid(tables, samples, clock)
    valid = grid.valid & np.isfinite(grid.position_m).all(-1)
    off = np.zeros(int(clock[-1]) + 1)
    off[clock] = late_s
    velocity, ahead = causal_velocity(grid.position_m, valid, np.arange(len(off)) * DT_S + off)
    unknown = valid & np.isnan(velocity).any(-1)
    flags = np.zeros(len(grid.agent_id), np.int32)
    flags[0] = int(TrackFlag.EGO)
    kinds = [AgentKind.CAR, *(kind_of(tables.category_of[name]) for name in grid.agent_id[1:])]
    tracks, dropped = checked_tracks(
        agent_id=grid.agent_id,
        kind=np.array([int(kind) for kind in kinds]),
        size_m=size_when_seen(grid.size_m, grid.valid, 0),
        position_m=grid.position_m - np.nan_to_num(velocity) * off[None, :, None],
        velocity_mps=velocity,
        heading_rad=grid.heading_rad,
        valid=grid.valid & ~unknown,
        dt_s=DT_S,
        origin_m=ORIGIN_M,
        file=folder,
        flags=flags,
        lookahead_steps=ahead,
    )
    boxes = int(np.isin(tables.sample, samples).sum())
    lost = {"orphan": orphans, "duplicate": grid.duplicates, "velocity_unknown": int(unknown.sum())}
    return Scene(
        scene_id=f"nuscenes_{record.name}",
        unit_id=f"nuscenes_{record.logfile or record.token}",
        source=SOURCE,
        scenario=record.location,
        tracks=tracks,
        road=road,
        start_s=(float(tables.time_us[samples[0]]) - log_begin_us) / 1e6,
        source_scenario_id=record.token,
        official_split="test" if folder.name.endswith("-test") else "",
        counts=row_counts(
            rows_in=boxes + len(samples) + orphans,
            rows_out=int(tracks.valid.sum()),
            dropped=added(lost, dropped),
        ),
    )


def _grid(tables: Tables, samples: np.ndarray, clock: np.ndarray) -> Grid:
    """Boxes and the ego vehicle of a scene."""
    place = np.full(len(tables.time_us), -1)
    place[samples] = clock
    rows = np.flatnonzero(place[tables.sample] >= 0)
    numbers = tables.numbers[rows]
    heading = heading_of(rotation_of(tables.pose[samples, 2:6]))
    ahead = np.stack([np.cos(heading), np.sin(heading)], -1) * EGO_AXLE_TO_CENTRE_M
    n_frames = int(clock[-1]) + 1
    ego_place, ego_heading = np.full((n_frames, 2), np.nan), np.full(n_frames, np.nan)
    ego_valid = np.zeros(n_frames, bool)
    ego_place[clock], ego_heading[clock] = tables.pose[samples, :2] + ahead, heading
    ego_valid[clock] = True
    return grid_of(
        agent=[tables.instance_id[i] for i in tables.instance[rows]],
        frame=place[tables.sample[rows]],
        position_m=numbers[:, 0:2],
        heading_rad=wrap_angle(heading_of(rotation_of(numbers[:, 4:8]))),
        size_m=numbers[:, [3, 2]],
        ego_id=EGO,
        ego_position_m=ego_place,
        ego_heading_rad=ego_heading,
        ego_size_m=EGO_SIZE_M,
        ego_valid=ego_valid,
    )
