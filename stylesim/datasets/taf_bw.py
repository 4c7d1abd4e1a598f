"""TAF-BW: the test area for autonomous driving of Baden-Württemberg, tracked from the roadside, with lanelet2 maps.

A site's folder holds `meta_data.csv` and `vehicle_tracks_<id>.csv` in the columns of INTERACTION (people are in the
same file); `signal_phases_<id>.csv` where `spatAvailable` (in one file spelled `spatAvailible`) says so. The map is
`<folder>.osm`, in it or in `maps/`. Its frame is a spherical Mercator projection from the origin that the meta data
give [read]; a UTM frame fits the cars on the first site as well (0.77 m from the lanes' middle instead of 0.83, 2,177
rows), which is within the tracks' own error. Files that follow one another are one continuous recording.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.interaction_folders import TRACKS, looks_like, site_of, sites
from stylesim.datasets.interaction_tables import read_tracks
from stylesim.datasets.light_logs import held_log, movement_state
from stylesim.datasets.maps.lanelet2 import read_lanelet2
from stylesim.datasets.maps.projection import mercator_from
from stylesim.datasets.recording import SignalLog
from stylesim.datasets.resampling import on_clock
from stylesim.datasets.sniffing import matching
from stylesim.datasets.tables import csv_table
from stylesim.datasets.track_table import recording_of
from stylesim.errors import InputError
from stylesim.road import Road
from stylesim.scene import Scene

SOURCE = "taf_bw"
JOINED_WITHIN_S = 60.0  # chosen, as for DLR: files that follow within a minute are one continuous recording
STALE_S = 1.0  # chosen: phases are logged ten times a second
_META: dict[str, Any] = {
    "id": pl.String, "frameRate_hz": pl.Float64, "speedLimit_kmh": pl.Float64, "date": pl.String,
    "startTime": pl.String, "originLat": pl.Float64, "originLon": pl.Float64,
}  # fmt: skip
_CLOCK = re.compile(r"^(\d{1,2}):(\d{1,2}):(\d{1,2}(?:\.\d+)?)$")


@dataclass(frozen=True)
class _Meta:
    """One row of the meta data."""

    rate_hz: float
    limit_mps: float
    origin: tuple[float, float]
    day: str
    start_s: float  # since midnight


def scenes(path: str | Path, *, scene_s: float = SCENE_S, map: str = "") -> Iterator[Scene]:
    """The scenes of a track file, a site's folder, or the data set's root, in time.

    `map` names a lanelet2 file, or "none". InputError names the file that is missing or damaged.
    """
    root = Path(path)
    found = False
    for folder, files in sites(root):
        site, map_file = site_of(folder, map)
        meta = _meta(folder / "meta_data.csv")
        unit, unit_start, previous = "", 0.0, None
        for number, tracks in sorted(files.items(), key=lambda item: _order(meta, item[0], folder)):
            found = True
            one = meta[number]
            recording_id = f"{SOURCE}_{site}_{number}"
            table, source, begin = read_tracks(tracks, recording_id, 1.0 / one.rate_hz)
            starts = one.start_s + begin
            if previous is None or one.day != previous[0] or not 0 <= starts - previous[1] <= JOINED_WITHIN_S:
                unit, unit_start = recording_id, starts
            raw, origin = recording_of(table, source, signals=_phases(folder, number, begin))
            previous = (one.day, starts + float(raw.frame.max(initial=0)) / one.rate_hz)
            road = None
            if map_file is not None:
                road = _limited(read_lanelet2(map_file, mercator_from(*one.origin), origin).road, one.limit_mps)
            yield from cut(
                on_clock(raw),
                source=SOURCE,
                scenario=site,
                unit_id=unit,
                origin_m=origin,
                road=road,
                scene_s=scene_s,
                unit_start_s=starts - unit_start,
            )
    if not found:
        raise InputError(f"{root} holds no vehicle_tracks_*.csv; it is no folder of TAF-BW")


def sniff(path: Path) -> bool:
    """True for a track file, a site's folder or the root, with meta data beside the tracks."""
    files = matching(path, *TRACKS)
    return bool(files) and looks_like(files[0]) and (files[0].parent / "meta_data.csv").is_file()


def _meta(file: Path) -> dict[str, _Meta]:
    if not file.is_file():
        raise InputError(f"{file} is missing; without it rate and origin of the recordings are unknown")
    found = {}
    for row in csv_table(file, _META).iter_rows(named=True):
        clock = _CLOCK.match((row["startTime"] or "").strip())
        rate, place = row["frameRate_hz"], (row["originLat"], row["originLon"])
        if row["id"] is None or clock is None or not rate or not 0.5 <= rate <= 200 or None in place:
            raise InputError(f"{file}: the row of recording {row['id']!r} has no usable rate, start time or origin")
        if not (abs(place[0]) <= 85 and abs(place[1]) <= 180):
            raise InputError(f"{file}: recording {row['id']!r} begins at {place}, which is no place on Earth")
        h, m, s = (float(part) for part in clock.groups())
        limit = row["speedLimit_kmh"]
        limit_mps = limit / 3.6 if limit is not None and 0 < limit < 200 else float("nan")
        found[row["id"]] = _Meta(rate, limit_mps, place, row["date"] or "", h * 3600 + m * 60 + s)
    return found


def _order(meta: dict[str, _Meta], number: str, folder: Path) -> tuple[str, float, str]:
    if number not in meta:
        raise InputError(f"{folder / 'meta_data.csv'} has no row for the recording {number}")
    return meta[number].day, meta[number].start_s, number


def _limited(road: Road, limit_mps: float) -> Road:
    """The site's limit on lanes whose map says none."""
    lanes = (
        replace(lane, speed_limit_mps=limit_mps) if np.isnan(lane.speed_limit_mps) else lane for lane in road.lanes
    )
    return replace(road, lanes=tuple(lanes))


def _phases(folder: Path, number: str, begin_s: float) -> SignalLog | None:
    """The lights of a recording on its clock (frame 0 is at `begin_s`); None where there is no log."""
    file = folder / f"signal_phases_{number}.csv"
    if not file.is_file():
        return None
    columns = {"signal_group_id": pl.String, "timestamp_ms": pl.Float64, "movement_state": pl.String}
    table = csv_table(file, columns).drop_nulls().filter(pl.col("timestamp_ms").is_finite())
    if table.is_empty():
        raise InputError(f"{file} has no usable row")
    states = {text: movement_state(text) for text in table["movement_state"].unique().to_list()}
    return held_log(
        table["timestamp_ms"].to_numpy() / 1000.0 - begin_s,
        table["signal_group_id"].to_list(),
        [states[text] for text in table["movement_state"].to_list()],
        stale_s=STALE_S,
    )
