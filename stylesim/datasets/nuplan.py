"""nuPlan: logs of 20 Hz as SQLite files (`<date>_<vehicle>_<from>_<to>.db`), lights by lane connector.

One log is one recording, cut into scenes at 10 Hz. Boxes are `lidar_box` rows; the ego vehicle is added from
`ego_pose`. The map is a download of its own (GeoPackage) and is not read; lights keep the id of their connector.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.dense import refuse_other_units
from stylesim.datasets.guarding import reading
from stylesim.datasets.nuplan_tables import EGO, TABLES, log_of
from stylesim.datasets.resampling import decimated
from stylesim.datasets.sniffing import listed, matching
from stylesim.datasets.sqlite_files import has_tables
from stylesim.errors import InputError
from stylesim.scene import Scene
from stylesim.tracks import TrackFlag

SOURCE = "nuplan"


def scenes(path: str | Path, *, scene_s: float = SCENE_S) -> Iterator[Scene]:
    """The scenes of a log, or of every log in a folder, by name, then in time, at 10 Hz.

    InputError names the file that is missing, damaged, or no log.
    """
    for file in files(path):
        with reading(file, "log of nuPlan"):
            log = log_of(file)
        recording = decimated(log.recording)
        begins_at = recording.position_m[np.argmin(recording.frame)]
        for scene in cut(
            recording,
            source=SOURCE,
            scenario=log.location,
            unit_id=log.recording.recording_id,
            origin_m=np.round(begins_at, -2),
            scene_s=scene_s,
        ):
            refuse_other_units(scene.tracks, file)
            tracks = scene.tracks
            assert tracks.flags is not None
            ego = np.array([int(TrackFlag.EGO) if i == EGO else 0 for i in tracks.agent_id], np.int32)
            yield replace(scene, tracks=replace(tracks, flags=tracks.flags | ego))


def files(path: str | Path) -> list[Path]:
    """The logs, each of which can be read alone; InputError where there is none."""
    found = _files(Path(path), listed)
    if not found:
        raise InputError(f"{path} holds no log of nuPlan (*.db)")
    return found


def sniff(path: Path) -> bool:
    """True for a log, or a folder with one."""
    found = _files(path, matching)
    return bool(found) and has_tables(found[0], TABLES)


def _files(path: Path, find: Callable[..., list[Path]]) -> list[Path]:
    return [path] if path.is_file() else find(path, "*.db", "*/*.db")
