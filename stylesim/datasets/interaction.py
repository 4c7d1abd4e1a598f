"""INTERACTION: recordings by drone and camera at intersections, merges and roundabouts, with lanelet2 maps.

A site's folder holds `vehicle_tracks_<n>.csv` and `pedestrian_tracks_<n>.csv`; n is one continuous recording. The map
is `<site>.osm` in it or in `maps/` beside `recorded_trackfiles/`; its frame is UTM from 0, 0 degrees, as in the data
set's own tools. Columns: `interaction_tables`. A signal log is not part of the format.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.interaction_folders import TRACKS, looks_like, site_of, sites
from stylesim.datasets.interaction_tables import read_tracks
from stylesim.datasets.maps.lanelet2 import read_lanelet2
from stylesim.datasets.maps.projection import from_origin
from stylesim.datasets.resampling import on_clock
from stylesim.datasets.sniffing import matching
from stylesim.datasets.track_table import recording_of
from stylesim.errors import InputError
from stylesim.scene import Scene

SOURCE = "interaction"
DT_S = 0.1


def scenes(path: str | Path, *, scene_s: float = SCENE_S, map: str = "") -> Iterator[Scene]:
    """The scenes of a track file, of a site's folder, or of the data set's root; by site, then number.

    `map` names a lanelet2 file, or "none"; else it is looked for. InputError names the file that is missing or damaged.
    """
    root = Path(path)
    found = False
    for folder, files in sites(root):
        site, map_file = site_of(folder, map)
        for number, tracks in files.items():
            found = True
            yield from _recording_scenes(tracks, site, number, map_file, scene_s)
    if not found:
        raise InputError(f"{root} holds no vehicle_tracks_*.csv; it is no folder of INTERACTION")


def sniff(path: Path) -> bool:
    """True for a track file, a site's folder or the root, without the meta data that TAF-BW adds."""
    files = matching(path, *TRACKS)
    return bool(files) and looks_like(files[0]) and not (files[0].parent / "meta_data.csv").is_file()


def _recording_scenes(
    tracks: list[Path], site: str, number: str, map_file: Path | None, scene_s: float
) -> Iterator[Scene]:
    recording_id = f"{SOURCE}_{site}_{number}"
    table, source, _ = read_tracks(tracks, recording_id, DT_S)
    raw, origin = recording_of(table, source)
    known = None if map_file is None else read_lanelet2(map_file, from_origin(0.0, 0.0), origin)
    yield from cut(
        on_clock(raw),
        source=SOURCE,
        scenario=site,
        unit_id=recording_id,
        origin_m=origin,
        road=None if known is None else known.road,
        scene_s=scene_s,
    )
