"""Argoverse 2 sensor logs: boxes around the vehicle at 10 Hz for 15 s (`annotations.feather`), poses, vector map.

One log is one scene and one unit. Boxes are in the frame of the ego vehicle and are brought into the city's; the
ego vehicle is added from `city_SE3_egovehicle.feather`. There are no velocities: they are made from the positions
seen so far (see `differences`). Logs of the test split have no boxes: only their ego vehicle is read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stylesim.datasets.accounting import added, row_counts
from stylesim.datasets.av2_map import read_map
from stylesim.datasets.av2_sensor_tables import KINDS, Boxes, boxes_of
from stylesim.datasets.dense import checked_tracks, origin_of, size_when_seen
from stylesim.datasets.differences import causal_velocity
from stylesim.datasets.guarding import reading
from stylesim.datasets.sniffing import listed, matching
from stylesim.errors import InputError
from stylesim.scene import Scene
from stylesim.tracks import AgentKind, TrackFlag

SOURCE = "av2_sensor"
DT_S = 0.1
STRIDE = 2  # frames; chosen: differences over 0.2 s instead of 0.1 s halve the noise of boxes drawn by hand
SPLITS = ("train", "val", "test")
POSES, ANNOTATIONS = "city_SE3_egovehicle.feather", "annotations.feather"


def scenes(path: str | Path) -> Iterator[Scene]:
    """The logs of a log's folder, of a split, or of a root with train/val/test; by split, then id.

    InputError where there is none, or a file is missing or damaged; it names the file.
    """
    found = list(_logs(Path(path)))
    if not found:
        raise InputError(f"{path} holds no sensor log of Argoverse 2 (a folder with {POSES})")
    for folder, split in found:
        yield _scene(folder, split)


def sniff(path: Path) -> bool:
    """True for a log's folder, a split, or a root with splits."""
    return path.is_dir() and bool(matching(path, POSES, f"*/{POSES}", f"*/*/{POSES}"))


def _logs(root: Path) -> Iterator[tuple[Path, str]]:
    if not root.is_dir():
        raise InputError(f"{root} is no folder; give a log's folder, a split, or the root of the data set")
    for file in listed(root, POSES) or listed(root, f"*/{POSES}", f"*/*/{POSES}"):
        split = file.parent.parent.name
        yield file.parent, split if split in SPLITS else ""


def _scene(folder: Path, split: str) -> Scene:
    file = folder / ANNOTATIONS
    with reading(file, "sensor log of Argoverse 2"):
        boxes = boxes_of(file, folder / POSES)
        return _of(boxes, folder, file, split)


def _of(boxes: Boxes, folder: Path, file: Path, split: str) -> Scene:
    grid = boxes.grid
    valid = grid.valid.copy()
    velocity, ahead = causal_velocity(grid.position_m, valid, np.arange(valid.shape[1]) * DT_S, STRIDE)
    unknown = valid & np.isnan(velocity).any(-1) & np.isfinite(grid.position_m).all(-1)
    valid &= ~unknown
    origin = origin_of(grid.position_m, grid.valid)
    flags = np.zeros(len(grid.agent_id), np.int32)
    flags[0] = int(TrackFlag.EGO)
    kinds = [KINDS.get(boxes.category[i], AgentKind.OTHER) if i >= 0 else AgentKind.CAR for i in grid.first_row]
    tracks, dropped = checked_tracks(
        agent_id=grid.agent_id,
        kind=np.array([int(kind) for kind in kinds]),
        size_m=size_when_seen(grid.size_m, grid.valid, 0),
        position_m=grid.position_m,
        velocity_mps=velocity,
        heading_rad=grid.heading_rad,
        valid=valid,
        dt_s=DT_S,
        origin_m=origin,
        file=file,
        flags=flags,
        lookahead_steps=ahead,
    )
    maps = matching(folder, "map/log_map_archive_*.json", "log_map_archive_*.json")
    city = re.search(r"____([A-Z]{3})_city", maps[0].name) if maps else None
    lost = {**boxes.dropped, "duplicate": grid.duplicates, "velocity_unknown": int(unknown.sum())}
    return Scene(
        scene_id=f"av2_sensor_{folder.name}",
        unit_id=f"av2_sensor_{folder.name}",
        source=SOURCE,
        scenario=city.group(1) if city else "av2",
        tracks=tracks,
        road=read_map(maps[0], origin) if maps else None,
        source_scenario_id=folder.name,
        official_split=split,
        counts=row_counts(rows_in=boxes.rows, rows_out=int(tracks.valid.sum()), dropped=added(lost, dropped)),
    )
