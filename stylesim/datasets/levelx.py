"""inD, rounD and exiD: intersections, roundabouts and motorway ramps in Germany by drone, at 25 Hz.

Columns as in the data sets' own format pages and tools [read]: centre, heading in degrees counter-clockwise, length
and width (0 for people and riders: a common size is taken), velocities in m/s, metres from the recording's UTM origin.
Maps are lanelet2 or OpenDRIVE files in a `maps` folder beside the data, by location; or the option `map`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.levelx_maps import map_of, read_map
from stylesim.datasets.levelx_tables import Triple, classes, recording_meta, triples, with_kinds
from stylesim.datasets.resampling import on_clock
from stylesim.datasets.tables import csv_table
from stylesim.datasets.track_table import Source, recording_of
from stylesim.errors import InputError
from stylesim.road import Road
from stylesim.scene import Scene

COLUMNS = ("trackId", "xCenter", "lonVelocity", "heading")
LANE_COLUMNS = ("laneletId", "latLaneCenterOffset")  # exiD only
UTM_EASTING_M, UTM_NORTHING_M = (100_000.0, 900_000.0), 10_000_000.0  # by definition of a zone
MAX_LIMIT_MPS = 70.0  # a limit above it, or -1, means none
_NUMBERS = ("frame", "xCenter", "yCenter", "heading", "width", "length", "xVelocity", "yVelocity")
_META = ("locationId", "speedLimit", "xUtmOrigin", "yUtmOrigin")


def recording_scenes(source: str, name: str, path: Path, *, scene_s: float = SCENE_S, map: str = "") -> Iterator[Scene]:
    """The scenes of the recordings at `path`; `source` is the reader's name, `name` the data set's.

    Each recording is a unit. `map` names a lanelet2 or OpenDRIVE file, or "none". InputError names the file that is
    missing, damaged, or in other units.
    """
    for triple in triples(path, name):
        meta = recording_meta(triple.recording_meta, _META)
        recording_id = f"{source}_{triple.number}"
        table, read = _tracks(triple, recording_id, 1.0 / meta["frameRate"])
        raw, origin = recording_of(table, read)
        location = int(meta["locationId"]) if _finite(meta["locationId"]) else -1
        file = map_of(triple.tracks, location, map)
        utm = _utm(meta, triple.recording_meta)
        road = None if file is None else _limited(read_map(file, utm, origin).road, meta["speedLimit"])
        yield from cut(
            on_clock(raw),
            source=source,
            scenario=f"{source}_location_{location}" if location >= 0 else f"{source}_unknown_site",
            unit_id=recording_id,
            origin_m=origin,
            road=road,
            scene_s=scene_s,
        )


def _tracks(triple: Triple, recording_id: str, dt_s: float) -> tuple[pl.DataFrame, Source]:
    raw = csv_table(triple.tracks, {"trackId": pl.String, **dict.fromkeys(_NUMBERS, pl.Float64)})
    dropped: dict[str, int] = {}
    frame = pl.col("frame")
    whole = frame.is_finite().fill_null(False) & (frame.abs() < 1e12) & ((frame - frame.round(0)).abs() < 1e-6)
    table = raw.filter(whole)
    dropped["unreadable"] = raw.height - table.height
    table = table.select(
        agent="trackId",
        frame=frame.round(0).cast(pl.Int64),
        x="xCenter",
        y="yCenter",
        vx="xVelocity",
        vy="yVelocity",
        heading=pl.col("heading").radians(),
        length="length",
        width="width",
    )
    return with_kinds(table, classes(triple.tracks_meta, "trackId"), dropped), Source(
        triple.tracks, recording_id, dt_s, dropped
    )


def _utm(meta: Mapping[str, Any], file: Path) -> tuple[float, float]:
    """The recording's UTM origin; InputError where it is no place of a zone."""
    x, y = meta["xUtmOrigin"], meta["yUtmOrigin"]
    if x is None or y is None or not (UTM_EASTING_M[0] <= x <= UTM_EASTING_M[1] and 0.0 <= y <= UTM_NORTHING_M):
        raise InputError(f"{file}: the UTM origin ({x}, {y}) is no easting and northing in metres")
    return float(x), float(y)


def _finite(value: Any) -> bool:
    return value is not None and math.isfinite(value) and abs(value) < 1e6


def _limited(road: Road, limit_mps: Any) -> Road:
    """The recording's limit on lanes whose map says none."""
    if not _finite(limit_mps) or not 0 < limit_mps < MAX_LIMIT_MPS:
        return road
    lanes = (
        replace(lane, speed_limit_mps=float(limit_mps)) if math.isnan(lane.speed_limit_mps) else lane
        for lane in road.lanes
    )
    return replace(road, lanes=tuple(lanes))
