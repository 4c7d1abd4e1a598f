"""nuPlan: logs of 20 Hz as SQLite files (`<date>_<vehicle>_<from>_<to>.db`), lights by lane connector.

One log is one recording, cut into scenes at 10 Hz. Boxes are `lidar_box` rows; the ego vehicle is added from
`ego_pose`. The map is a download of its own (GeoPackage, see `nuplan_map`): the one that is given, or the one of the
log's location in a `maps` folder beside the logs or above them; each scene has the lanes within reach of its first
frame. Lights name the lane connector that they control, with or without map.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.dense import refuse_other_units
from stylesim.datasets.guarding import reading
from stylesim.datasets.maps.city import CityMap
from stylesim.datasets.nuplan_map import city_map
from stylesim.datasets.nuplan_tables import EGO, TABLES, log_of
from stylesim.datasets.resampling import decimated
from stylesim.datasets.sniffing import listed, matching
from stylesim.datasets.sqlite_files import has_tables
from stylesim.errors import InputError
from stylesim.scene import Scene
from stylesim.tracks import TrackFlag

SOURCE = "nuplan"
MAPS_ABOVE = 5  # dataset/maps, dataset/nuplan-v1.1/splits/mini/<log>.db is the layout that is published


def scenes(path: str | Path, *, scene_s: float = SCENE_S, map: str = "") -> Iterator[Scene]:
    """The scenes of a log, or of every log in a folder, by name, then in time, at 10 Hz.

    `map` is a map.gpkg, the `maps` folder of the data set, or "none". InputError names the file that is missing,
    damaged, or no log.
    """
    for file in files(path):
        with reading(file, "log of nuPlan"):
            log = log_of(file)
        where = map_of(file, log.location, map)
        city = None if where is None else _city(where, where.stat().st_mtime_ns)
        recording = decimated(log.recording)
        if city is not None and city.incomplete:
            recording = replace(recording, notes={**recording.notes, "map_lanes_incomplete": city.incomplete})
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
            scene = replace(scene, road=None if city is None else city.around(tracks, scene_s))
            yield replace(scene, tracks=replace(tracks, flags=tracks.flags | ego))


@lru_cache(maxsize=1)  # logs are read by name, hence by day, and mostly of one city after the other
def _city(file: Path, changed_ns: int) -> CityMap:
    return city_map(file)


def map_of(log: Path, location: str, given: str) -> Path | None:
    """The map for a log: the given file, or the one in the given or nearest `maps` folder; None where there is none.

    InputError where `given` is none, or holds none of that location.
    """
    if given == "none":
        return None
    if given and Path(given).is_file():
        return Path(given)
    if "/" in location or "\\" in location or location.startswith("."):
        raise InputError(f"{log} says that it was recorded at {location!r:.60}, which is no name of a folder")
    folders = [Path(given)] if given else [parent / "maps" for parent in log.resolve().parents[:MAPS_ABOVE]]
    for folder in folders:
        found = sorted((folder / location).glob("*/map.gpkg"))
        if len(found) > 1:
            raise InputError(f"{folder / location} holds {len(found)} versions of the map; say which with map=FILE")
        if found:
            return found[0]
    if given:
        raise InputError(f"{given} is no map.gpkg and holds no {location}/<version>/map.gpkg")
    return None


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
