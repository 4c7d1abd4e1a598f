"""Which map belongs to a recording of levelXData, and how it is read."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.maps.lanelet2 import read_lanelet2
from stylesim.datasets.maps.opendrive import read_opendrive
from stylesim.datasets.maps.projection import from_utm_origin
from stylesim.datasets.maps.site_map import SiteMap
from stylesim.errors import InputError

ENDINGS = (".osm", ".xodr")  # in this order: lanelet2 has stop lines


def map_of(tracks: Path, location: int, given: str) -> Path | None:
    """The map of a location: the one that is given, else the one file of a `maps` folder that names the location.

    A file names it as `location3.osm`, `3_name.xodr` or `03_name/….osm`. None where there is no such folder or file.
    """
    if given:
        return None if given == "none" else Path(given)
    if location < 0:
        return None
    for folder in (tracks.parent / "maps", tracks.parent.parent / "maps", tracks.parent.parent / "lanelets"):
        if not folder.is_dir():
            continue
        for ending in ENDINGS:
            found = [f for f in sorted(folder.rglob(f"*{ending}")) if _names(f.relative_to(folder), location)]
            if len(found) > 1:
                raise InputError(f"{folder} holds {len(found)} maps of location {location}; say which with map=FILE")
            if found:
                return found[0]
    return None


def _names(file: Path, location: int) -> bool:
    named = re.compile(rf"^(?:location_?)?0*{location}(?:[_.\-]|$)", re.IGNORECASE)
    return any(named.match(part) for part in file.parts)


def read_map(file: Path, utm_origin_m: tuple[float, float], origin_m: Float64[np.ndarray, " 2"]) -> SiteMap:
    """A lanelet2 or OpenDRIVE map in metres from `origin_m`, which counts from the recording's UTM origin."""
    if file.suffix == ".xodr":
        return read_opendrive(file, origin_m, utm_origin_m=np.array(utm_origin_m))
    return read_lanelet2(file, from_utm_origin(*utm_origin_m), origin_m)
