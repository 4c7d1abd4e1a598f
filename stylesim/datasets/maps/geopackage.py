"""Lines and areas of a GeoPackage (OGC 12-128r19): a SQLite file whose geometries are well-known binary."""

from __future__ import annotations

import re
import sqlite3
import struct
from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.maps.projection import utm

LINE, AREA, MANY_LINES, MANY_AREAS = 2, 3, 5, 6
_ENVELOPE_BYTES = {0: 0, 1: 32, 2: 48, 3: 48, 4: 64}  # by the indicator in the header's flags
_DIMENSIONS = {0: 2, 1: 3, 2: 3, 3: 4}  # by thousands of the type: plain, with height, with measure, with both
_WGS_84 = 4326
MAX_POINTS = 1_000_000  # chosen: of one geometry; a damaged number of points would ask for any memory


def geometry(blob: Any) -> Float64[np.ndarray, "point 2"]:
    """The points of a line, of the outline of an area, or of the longest one of several; in the order of the file.

    ValueError for any other geometry, an empty one, and what is no GeoPackage geometry.
    """
    if not isinstance(blob, bytes) or len(blob) < 8 or blob[:2] != b"GP":
        raise ValueError("a geometry does not begin as one of a GeoPackage")
    flags = blob[3]
    begin = 8 + _ENVELOPE_BYTES.get(flags >> 1 & 7, len(blob))
    lines: list[Float64[np.ndarray, "_ 2"]] = []
    _parse(blob, begin, lines, depth=0)
    if not lines:
        raise ValueError("a geometry is empty")
    return max(lines, key=len)


def _parse(blob: bytes, at: int, lines: list[Float64[np.ndarray, "_ 2"]], *, depth: int) -> int:
    """Add the lines of the geometry at `at`; where the next one begins."""
    if at + 9 > len(blob) or blob[at] > 1:
        raise ValueError("a geometry is cut off")
    order = "<" if blob[at] else ">"
    code, n = struct.unpack_from(order + "II", blob, at + 1)
    kind, dimensions = code % 1000, _DIMENSIONS.get(code // 1000)
    at += 9
    if dimensions is None or n > MAX_POINTS:
        raise ValueError(f"a geometry of type {code} with {n} parts")
    if kind == LINE:
        return _points(blob, at, n, order, dimensions, lines)
    if kind == AREA:
        for ring in range(n):
            (count,) = struct.unpack_from(order + "I", blob, at)
            at = _points(blob, at + 4, count, order, dimensions, lines if ring == 0 else [])
        return at
    if kind in (MANY_LINES, MANY_AREAS) and depth == 0:
        for _ in range(n):
            at = _parse(blob, at, lines, depth=1)
        return at
    raise ValueError(f"a geometry of type {code}, neither line nor area")


def _points(blob: bytes, at: int, n: int, order: str, dimensions: int, lines: list[Float64[np.ndarray, "_ 2"]]) -> int:
    if n > (len(blob) - at) // (8 * dimensions):
        raise ValueError("a geometry is cut off")
    values = np.frombuffer(blob, f"{order}f8", n * dimensions, at).reshape(n, dimensions)
    lines.append(values[:, :2].astype(np.float64))
    return at + 8 * dimensions * n


class Projection:
    """From the coordinates of one table to metres in the UTM zone that the file's `meta` table names."""

    def __init__(self, database: sqlite3.Connection, table: str) -> None:
        named = database.execute("SELECT value FROM meta WHERE key = 'projectedCoordSystem'").fetchone()
        match = re.fullmatch(r"epsg:32([67])(\d\d)", str(named[0]).strip().lower()) if named else None
        if match is None or not 1 <= int(match[2]) <= 60:
            raise ValueError(f"the map's projection is {named and named[0]!r:.40}, no UTM zone of WGS 84 (epsg:326..)")
        self.zone, self.south = int(match[2]), match[1] == "7"
        found = database.execute("SELECT srs_id FROM gpkg_geometry_columns WHERE table_name = ?", (table,)).fetchone()
        metres = int(f"32{match[1]}{match[2]}")
        if found is None or found[0] not in (_WGS_84, metres):
            raise ValueError(f"{table} is in the system {found and found[0]!r:.20}, neither degrees nor the map's zone")
        self.degrees = found[0] == _WGS_84

    def __call__(self, points: Float64[np.ndarray, "point 2"]) -> Float64[np.ndarray, "point 2"]:
        """The points in metres; x and y of the file are longitude and latitude. ValueError where they are none."""
        if not self.degrees:
            return points
        longitude, latitude = points.T
        if not ((np.abs(latitude) < 85) & (np.abs(longitude - (6 * self.zone - 183)) < 10)).all():  # NaN fails too
            raise ValueError("a point of the map is not within its zone")
        return utm(latitude, longitude, zone=self.zone, south=self.south)
