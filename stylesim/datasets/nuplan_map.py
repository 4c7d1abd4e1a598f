"""The map of a nuPlan city: `maps/<location>/<version>/map.gpkg`, a download of its own.

Tables and columns are those that the published devkit reads (nuplan/common/maps/nuplan_map). Lanes and the connectors
of junctions have their baseline as centre line; what a light controls is a connector. Left out: car parks, walkways,
drivable areas, intersections as areas, speed bumps.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from stylesim.datasets.guarding import reading
from stylesim.datasets.maps.city import CityMap
from stylesim.datasets.maps.geopackage import Projection, geometry
from stylesim.datasets.polylines import map_line, nearest_points, stop_line_at
from stylesim.datasets.sqlite_files import opened
from stylesim.errors import InputError
from stylesim.road import Lane

TABLES = (
    "meta", "gpkg_geometry_columns", "baseline_paths", "boundaries", "lanes_polygons", "lane_connectors",
    "gen_lane_connectors_scaled_width_polygons", "stop_polygons", "crosswalks",
)  # fmt: skip
_LANES = "SELECT lane_fid, left_boundary_fid, right_boundary_fid, speed_limit_mps, lane_group_fid FROM lanes_polygons"
_CONNECTORS = """
SELECT c.fid, p.left_boundary_fid, p.right_boundary_fid, c.speed_limit_mps, c.exit_lane_fid, c.entry_lane_fid,
  c.traffic_light_stop_line_fids
FROM lane_connectors c LEFT JOIN gen_lane_connectors_scaled_width_polygons p ON p.lane_connector_fid = c.fid
"""
# stop_polygon_type_fid [read: StopLineType of the devkit]: lights, stop signs, yield signs; the rest has no stop line.
TRAFFIC_LIGHT = 2
STOPPING = (1, TRAFFIC_LIGHT, 4)
WIDTH_M = (1.0, 10.0)  # chosen: other widths are of lanes with odd boundaries
MAX_LIMIT_MPS = 60.0  # 216 km/h

Line = Float64[np.ndarray, "_ 2"]
Point = Float64[np.ndarray, " 2"]


def city_map(file: Path) -> CityMap:
    """The map in that file. InputError where it is damaged or no map of nuPlan."""
    with reading(file, "map of nuPlan"), opened(file, TABLES) as database:
        boundaries = _lines(database, "boundaries", "fid")
        stops = {fid: area.mean(axis=0) for fid, area in _lines(database, "stop_polygons", "fid").items()}
        centres = _lines(database, "baseline_paths", "lane_fid")
        between = _lines(database, "baseline_paths", "lane_connector_fid")
        crosswalks = tuple(_lines(database, "crosswalks", "fid").values())
        lane_rows = sorted(database.execute(_LANES).fetchall(), key=lambda row: int(row[0]))
        joints = sorted(database.execute(_CONNECTORS).fetchall(), key=lambda row: int(row[0]))
        stop_of = _stops_of_lanes(database, stops)
        if not centres:
            raise InputError(f"{file} has no lane with a baseline path")
        origin = np.round(np.median(np.concatenate(list(centres.values())), axis=0))
        clash = {int(row[0]) for row in lane_rows} & {int(row[0]) for row in joints}
        names = {int(row[0]): f"lane_{row[0]}" if int(row[0]) in clash else str(row[0]) for row in lane_rows}
        lanes = []
        for fid, left, right, limit, _ in lane_rows:
            follow = [str(row[0]) for row in joints if row[4] == fid and row[0] in between]
            if fid in centres:
                ends = (boundaries.get(left), boundaries.get(right))
                lanes.append(_lane(names[fid], centres[fid], ends, limit, follow, stop_of.get(fid), origin))
        for fid, left, right, limit, _, entry, stop_fids in joints:
            if fid in between:
                stop = next((stops[i] for i in _ids(stop_fids) if i in stops), None)
                follow = [names[entry]] if entry in centres and entry in names else []
                ends = (boundaries.get(left), boundaries.get(right))
                lane = _lane(str(fid), between[fid], ends, limit, follow, stop, origin)
                lanes.append(replace(lane, in_junction=True))
    beside = _neighbours(lane_rows, names)
    for i, lane in enumerate(lanes):
        left_id, right_id = beside.get(lane.lane_id, ("", ""))
        lanes[i] = replace(lane, left_neighbour=left_id, right_neighbour=right_id)
    incomplete = len(lane_rows) + len(joints) - len(lanes)
    return CityMap(lanes=tuple(lanes), crosswalks_m=crosswalks, origin_m=origin, incomplete=incomplete)


def _lines(database: sqlite3.Connection, table: str, key: str) -> dict[int, Line]:
    """The geometries of a table in metres, by a column of numbers; rows without one are left out."""
    place = Projection(database, table)
    rows = database.execute(f"SELECT {key}, geom FROM {table} WHERE {key} IS NOT NULL AND geom IS NOT NULL")
    return {int(number): place(geometry(blob)) for number, blob in rows}


def _stops_of_lanes(database: sqlite3.Connection, stops: Mapping[int, Point]) -> dict[int, Point]:
    """Where the stop line of each lane is; the one of its light where it has several."""
    rows = database.execute("SELECT fid, lane_fids, stop_polygon_type_fid FROM stop_polygons").fetchall()
    found: dict[int, Point] = {}
    for fid, lanes, kind in sorted(rows, key=lambda row: (row[2] == TRAFFIC_LIGHT, row[0])):
        if kind in STOPPING and fid in stops:
            found |= dict.fromkeys(_ids(lanes), stops[fid])
    return found


def _ids(text: Any) -> list[int]:
    """The numbers of a column such as "12,13"."""
    return [int(part) for part in str(text).split(",") if part.strip()] if text is not None else []


def _lane(
    lane_id: str,
    centre: Line,
    ends: tuple[Line | None, Line | None],
    limit: Any,
    successors: Iterable[str],
    stop: Point | None,
    origin_m: Point,
) -> Lane:
    line = map_line(centre, origin_m)
    sides = [None if side is None else _along(map_line(side, origin_m), line) for side in ends]
    width = math.nan
    if sides[0] is not None and sides[1] is not None:
        places = line.astype(np.float64)
        apart = sum(np.hypot(*(nearest_points(places, side) - places).T) for side in sides if side is not None)
        width = float(np.median(apart))
    width = width if WIDTH_M[0] <= width <= WIDTH_M[1] else math.nan
    return Lane(
        lane_id=lane_id,
        centre_line_m=line,
        width_m=width,
        speed_limit_mps=float(limit) if limit is not None and 0 < float(limit) < MAX_LIMIT_MPS else math.nan,
        left_boundary_m=sides[0],
        right_boundary_m=sides[1],
        successors=tuple(dict.fromkeys(successors)),
        stop_line_m=None if stop is None else stop_line_at(stop - origin_m, line, width),
    )


def _along(side: Float32[np.ndarray, "a 2"], line: Float32[np.ndarray, "b 2"]) -> Float32[np.ndarray, "a 2"]:
    """A boundary in the direction of its lane: two lanes of opposite directions may share one."""
    straight = np.hypot(*(side[0] - line[0])) + np.hypot(*(side[-1] - line[-1]))
    turned = np.hypot(*(side[0] - line[-1])) + np.hypot(*(side[-1] - line[0]))
    return side if straight <= turned else side[::-1]


def _neighbours(rows: Sequence[tuple[Any, ...]], names: Mapping[int, str]) -> dict[str, tuple[str, str]]:
    """Left and right of lanes of one group, hence of one direction, that share a boundary."""
    right_of = {(row[4], row[1]): names[int(row[0])] for row in rows if row[1] is not None}
    left_of = {(row[4], row[2]): names[int(row[0])] for row in rows if row[2] is not None}
    return {names[int(row[0])]: (left_of.get((row[4], row[1]), ""), right_of.get((row[4], row[2]), "")) for row in rows}
