"""DLR Urban Traffic: one signalised intersection in Braunschweig, tracked at 20 Hz, lights at about 1 Hz.

A recording is `trajectories_<begin>_<end>.csv.gz`, its lights are `traffic-lights_<begin>_<end>.csv.gz` beside
it. Columns and state codes: data/README.md. Positions are UTM metres, yaw is in degrees counter-clockwise from
east [read from the file: within 1.1 degrees of the velocity above 3 m/s]. There is no map: lanes come from the
frozen road of the site (`site_roads`), or are inferred from the recording itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.dlr_folders import JOINED_WITHIN_S, track_files
from stylesim.datasets.dlr_tables import recording_from
from stylesim.datasets.inferred_road import infer_road
from stylesim.datasets.light_links import linked, with_stop_lines
from stylesim.datasets.recording import Recording
from stylesim.datasets.resampling import decimated
from stylesim.datasets.site_roads import SiteRoad, load_site_road, site_road_at
from stylesim.datasets.sniffing import header, matching
from stylesim.datasets.stamps import Stamp
from stylesim.errors import unknown
from stylesim.road import Road
from stylesim.scene import Scene

SOURCE = "dlr_ut"


def scenes(path: str | Path, *, scene_s: float = SCENE_S, road: str = "site", links: str = "none") -> Iterator[Scene]:
    """The scenes of a recording, or of every recording in a folder, in time, at 10 Hz.

    `road`: "site" takes the road that is shipped for the place where the recording begins, if there is one;
    "infer" makes it from the whole recording (so it knows what comes after any t0: for looking, not for
    forecasting); "none" gives scenes without lanes; anything else is a file that `save_site_road` wrote.
    `links`: no table says which light is for which lane; "infer" takes it from who crosses when in the whole
    recording, where that leaves 95 % for one light (see `light_links`): in the shipped five minutes for 2 of 9 lanes.
    InputError names the file that is missing, damaged, or in other units.
    """
    if links not in ("none", "infer"):
        raise unknown("links", links, ("none", "infer"))
    files = track_files(Path(path), "DLR Urban Traffic")
    chosen = None if road in ("site", "infer", "none") else load_site_road(Path(road))
    unit_id, unit_begin, previous = "", 0, None
    for file in files:
        stamp = Stamp.of(file)
        raw, begin = recording_from(file, _lights_file(file), stamp)
        if stamp is None or previous is None or not stamp.continues(previous, within_s=JOINED_WITHIN_S):
            unit_id, unit_begin = raw.recording_id, begin
        previous = stamp
        name, lanes, origin = _site(road, chosen, raw)
        if links == "infer" and lanes is not None:
            raw = linked(raw, with_stop_lines(lanes), origin)
        yield from cut(
            decimated(raw),
            source=SOURCE,
            scenario=name,
            unit_id=unit_id,
            origin_m=origin,
            road=lanes,
            scene_s=scene_s,
            unit_start_s=(begin - unit_begin) / 1e6,
        )


def sniff(path: Path) -> bool:
    """True for a trajectories file with the columns of DLR Urban Traffic, or a folder with one."""
    files = [path] if path.is_file() else matching(path, "trajectories_*.csv", "trajectories_*.csv.gz")
    names = set(header(files[0])) if files else set()
    return {"center_easting", "classifications_van", "interpolated"} <= names and "acceleration_signed" not in names


def _site(road: str, chosen: SiteRoad | None, raw: Recording) -> tuple[str, Road | None, Float64[np.ndarray, " 2"]]:
    """Name and road of the site and the origin of the scenes; all follow from where the recording begins."""
    begins_at = raw.position_m[np.argmin(raw.frame)]
    origin = np.round(begins_at, -2)
    known = chosen or site_road_at(SOURCE, begins_at)
    name = known.name if known else "unknown_site"
    if road == "infer":
        return name, infer_road(raw, origin), origin
    if road == "none" or known is None:
        return name, None, origin
    return name, known.road, known.origin_m


def _lights_file(tracks: Path) -> Path | None:
    if not tracks.name.startswith("trajectories_"):
        return None
    stem = tracks.name.replace("trajectories_", "traffic-lights_", 1).split(".")[0]
    for ending in (".csv.gz", ".csv"):
        lights = tracks.with_name(stem + ending)
        if lights.is_file():
            return lights
    return None
