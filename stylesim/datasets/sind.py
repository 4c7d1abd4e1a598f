"""SinD: signalised intersections of Chinese cities by drone, with lights and lanelet2 maps.

A recording's folder holds `Veh_smoothed_tracks.csv`, `Ped_smoothed_tracks.csv` and `TrafficLight_*.csv`; the map is
the `*.osm` in it or in one of the folders above, in UTM from 0, 0 degrees. Tracks are at a third of 29.97 Hz, hence at
9.99 Hz: frames are taken as 0.1 s apart (see `resampling.SAME_CLOCK`), and the lights, which are logged at each change,
go with them. The map names only some of the lights; the others' lanes are unknown, or inferred from who crosses when
(`links=infer`, see `light_links`). The public sample has no vehicle tracks; the columns are those of its Format.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.interaction_tables import KINDS
from stylesim.datasets.light_links import LINKS, linked
from stylesim.datasets.light_logs import held_log
from stylesim.datasets.maps.lanelet2 import read_lanelet2
from stylesim.datasets.maps.projection import from_origin
from stylesim.datasets.maps.site_map import SiteMap
from stylesim.datasets.recording import SignalLog
from stylesim.datasets.resampling import on_clock
from stylesim.datasets.sniffing import header, matching
from stylesim.datasets.table_clock import on_frames, step_s
from stylesim.datasets.tables import csv_table
from stylesim.datasets.track_table import Source, recording_of
from stylesim.errors import InputError, unknown
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind

SOURCE = "sind"
STATES = {0: SignalState.RED, 1: SignalState.GREEN, 3: SignalState.YELLOW}  # [read: Format.md of the data set]
# Logged when they change: they hold. Chosen: ten minutes, several times the longest cycle, and the log has ended.
STALE_S = 600.0
_VEHICLES, _PEOPLE = "Veh_smoothed_tracks.csv", "Ped_smoothed_tracks.csv"
_COMMON: dict[str, Any] = {
    "track_id": pl.String,
    "timestamp_ms": pl.Float64,
    "agent_type": pl.String,
    **dict.fromkeys(("x", "y", "vx", "vy"), pl.Float64),
}
_BOX: dict[str, Any] = dict.fromkeys(("yaw_rad", "length", "width"), pl.Float64)


def scenes(path: str | Path, *, scene_s: float = SCENE_S, map: str = "", links: str = "map") -> Iterator[Scene]:
    """The scenes of a recording's folder, or of every such folder below, in the order of their names.

    `map` names a lanelet2 file, or "none". `links`: "map" (what the map says), "infer" (from behaviour, for the
    lights that the map does not name), or "none". InputError names the file that is missing or damaged.
    """
    if links not in LINKS:
        raise unknown("links", links, LINKS)
    root = Path(path)
    folders = [root] if (root / _VEHICLES).is_file() else sorted(f.parent for f in root.glob(f"**/{_VEHICLES}"))
    if not folders:
        raise InputError(f"{root} holds no {_VEHICLES}; the tables of meta data alone are no recording")
    for folder in folders:
        name = f"{SOURCE}_{folder.name}"
        table, source, begin = _tracks(folder, name)
        log = _lights(folder, begin)
        raw, origin = recording_of(table, source, signals=log)
        found = _map_file(folder, map)
        site = None if found is None else read_lanelet2(found, from_origin(0.0, 0.0), origin)
        raw = on_clock(replace(raw, signals=_mapped(log, site, links)))
        raw = linked(raw, None if site is None else site.road, origin) if links == "infer" else raw
        yield from cut(
            raw,
            source=SOURCE,
            scenario="unknown_site" if found is None else found.stem,
            unit_id=name,
            origin_m=origin,
            road=None if site is None else site.road,
            scene_s=scene_s,
        )


def sniff(path: Path) -> bool:
    """True for a recording's folder, or one a level or two above, with tracks of vehicles."""
    files = matching(path, _VEHICLES, f"*/{_VEHICLES}", f"*/*/{_VEHICLES}") if path.is_dir() else []
    return bool(files) and {"track_id", "timestamp_ms", "yaw_rad", "a_lon"} <= set(header(files[0]))


def _tracks(folder: Path, name: str) -> tuple[pl.DataFrame, Source, float]:
    parts = []
    for file in (folder / _VEHICLES, folder / _PEOPLE):
        if not file.is_file():
            continue  # an intersection without people has no such file
        box = _BOX if file.name == _VEHICLES else {}
        table = csv_table(file, _COMMON | box)
        absent = [pl.lit(None, pl.Float64).alias(column) for column in _BOX if column not in box]
        parts.append(table.with_columns(absent).select(*_COMMON, *_BOX))
    raw = pl.concat(parts)
    kinds = {text: int(kind) for text, kind in KINDS.items()}
    kind = pl.col("agent_type").str.to_lowercase().str.strip_chars()
    table = raw.select(
        agent="track_id",
        t=pl.col("timestamp_ms") / 1000.0,
        x="x",
        y="y",
        vx="vx",
        vy="vy",
        kind=kind.replace_strict(kinds, default=int(AgentKind.OTHER), return_dtype=pl.Int8),
        heading=pl.when((kind == "pedestrian") & pl.col("yaw_rad").is_null())
        .then(pl.arctan2("vy", "vx"))
        .otherwise("yaw_rad"),
        length="length",
        width="width",
    )
    file = folder / _VEHICLES
    dt_s = step_s(table, file)
    dropped: dict[str, int] = {}
    table, begin = on_frames(table, dt_s, file, dropped)
    return table, Source(file, name, dt_s, dropped), begin


def _lights(folder: Path, begin_s: float) -> SignalLog | None:
    """What the lights showed on the recording's clock; None where there is no log."""
    files = sorted(folder.glob("TrafficLight*.csv"))
    if not files:
        return None
    if len(files) > 1:
        raise InputError(f"{folder} holds {len(files)} TrafficLight*.csv; a recording has one")
    names = [name for name in header(files[0]) if name.lower().startswith("traffic light")]
    clock = next((name for name in header(files[0]) if name.lower().startswith("timestamp")), "timestamp(ms)")
    if not names:
        raise InputError(f"{files[0]} has no column 'Traffic light …'")
    table = csv_table(files[0], {clock: pl.Float64, **dict.fromkeys(names, pl.Int64)})
    table = table.filter(pl.col(clock).is_finite().fill_null(False))
    if table.is_empty():
        raise InputError(f"{files[0]} has no usable row")
    time, light, state = [], [], []
    for row in table.iter_rows(named=True):
        for name in names:
            if row[name] is not None:
                time.append(row[clock] / 1000.0 - begin_s)
                light.append(name)
                state.append(STATES.get(row[name], SignalState.UNKNOWN))
    if not time:
        raise InputError(f"{files[0]} says the state of no light")
    return held_log(np.array(time, np.float64), light, state, stale_s=STALE_S)


def _mapped(log: SignalLog | None, site: SiteMap | None, links: str) -> SignalLog | None:
    if log is None or site is None or links == "none":
        return log
    return replace(log, lane_id=site.light_lanes(log.signal_id))


def _map_file(folder: Path, given: str) -> Path | None:
    if given:
        return None if given == "none" else Path(given)
    for place in (folder, folder.parent, folder.parent.parent):
        maps = sorted(place.glob("*.osm"))
        if len(maps) > 1:
            raise InputError(f"{place} holds {len(maps)} maps (*.osm); say which with the option map=FILE")
        if maps:
            return maps[0]
    return None
