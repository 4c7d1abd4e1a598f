"""Logs of nuPlan (SQLite), written by the tests with the tables that a reader of tracks needs."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from tests.formats.mutations import FACTORS
from tests.formats.world import CROSSWALK, LANES, LINES, ORIGIN, SPEED_LIMIT_MPS, World

BEGIN_US = 1_632_878_371_800_263
NAME = "2021.09.29.01.04.10_veh-49_00808_00872.db"
SCHEMA = """
CREATE TABLE log (token BLOB PRIMARY KEY, vehicle_name VARCHAR(64), date VARCHAR(64), timestamp INTEGER,
  logfile VARCHAR(64), location VARCHAR(64), map_version VARCHAR(64));
CREATE TABLE lidar_pc (token BLOB PRIMARY KEY, next_token BLOB, prev_token BLOB, ego_pose_token BLOB NOT NULL,
  lidar_token BLOB, scene_token BLOB, filename VARCHAR(128), timestamp INTEGER);
CREATE TABLE ego_pose (token BLOB PRIMARY KEY, timestamp INTEGER, x FLOAT, y FLOAT, z FLOAT, qw FLOAT, qx FLOAT,
  qy FLOAT, qz FLOAT, vx FLOAT, vy FLOAT, vz FLOAT, log_token BLOB);
CREATE TABLE category (token BLOB PRIMARY KEY, name VARCHAR(64), description TEXT);
CREATE TABLE track (token BLOB PRIMARY KEY, category_token BLOB NOT NULL, width FLOAT, length FLOAT, height FLOAT);
CREATE TABLE lidar_box (token BLOB PRIMARY KEY, lidar_pc_token BLOB NOT NULL, track_token BLOB NOT NULL,
  x FLOAT, y FLOAT, z FLOAT, width FLOAT, length FLOAT, height FLOAT, vx FLOAT, vy FLOAT, vz FLOAT, yaw FLOAT,
  confidence FLOAT);
CREATE TABLE traffic_light_status (token BLOB PRIMARY KEY, lidar_pc_token BLOB NOT NULL, lane_connector_id INTEGER,
  status VARCHAR(8));
"""
CATEGORIES = {"car": "vehicle", "cyclist": "bicycle", "pedestrian": "pedestrian"}
EGO_POSE_LATE_US = 20_000  # the ego pose is taken a little after the sweep


def _token(*parts: int) -> bytes:
    return b"".join(p.to_bytes(3, "big") for p in parts)


def write(folder: Path, *, n_frames: int = 200, damage: str = "") -> Path:
    """A log whose ego vehicle is car 0 of the world; `damage` is SQL to run at the end."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / NAME
    w = World(n_frames=n_frames, dt_s=0.05)
    with closing(sqlite3.connect(file)) as db:
        db.executescript(SCHEMA)
        insert(db, "log", (b"l", "veh-49", "2021-09-29", BEGIN_US, NAME, "us-nv-las-vegas-strip", "v"))
        for name in CATEGORIES.values():
            insert(db, "category", (name.encode(), name, ""))
        for a in range(1, len(w.id)):
            kind = CATEGORIES[w.kind[a]].encode()
            insert(db, "track", (_token(1, w.id[a]), kind, w.size[a, 1], w.size[a, 0], 1.5))
        for t in range(n_frames):
            time, late = BEGIN_US + 50_000 * t, EGO_POSE_LATE_US
            frame, pose = _token(2, t), _token(3, t)
            insert(db, "lidar_pc", (frame, None, None, pose, b"x", None, "", time))
            axle = w.position[0, t] + w.velocity[0, t] * late / 1e6 - [5.176 / 2 - 1.127, 0]
            yaw = w.heading[0, t] / 2
            quaternion = (np.cos(yaw), 0.0, 0.0, np.sin(yaw))
            insert(
                db, "ego_pose", (pose, time + late, *axle.tolist(), 0.0, *quaternion, w.velocity[0, t, 0], 0, 0, b"l")
            )
            for a in range(1, len(w.id)):
                if w.valid[a, t]:
                    (x, y), (vx, vy) = w.position[a, t].tolist(), w.velocity[a, t].tolist()
                    row = (x, y, 0.0, w.size[a, 1], w.size[a, 0], 1.5, vx, vy, 0.0, w.heading[a, t], 0.9)
                    insert(db, "lidar_box", (_token(4, a, t), frame, _token(1, w.id[a]), *row))
            if t % 2 == 0 or t > 50:
                insert(db, "traffic_light_status", (_token(5, t), frame, 49585, "red" if t < 100 else "green"))
        if damage:
            db.executescript(damage)
        db.commit()
    return file


MAP_SCHEMA = """
CREATE TABLE meta (id INTEGER PRIMARY KEY, key TEXT, value TEXT);
CREATE TABLE gpkg_geometry_columns (table_name TEXT, column_name TEXT, geometry_type_name TEXT, srs_id INTEGER);
CREATE TABLE boundaries (fid INTEGER PRIMARY KEY, geom LINESTRING, boundary_type_fid INTEGER);
CREATE TABLE baseline_paths (fid INTEGER PRIMARY KEY, geom LINESTRING, path_type_fid INTEGER, lane_fid INTEGER,
  lane_connector_fid INTEGER);
CREATE TABLE lanes_polygons (fid INTEGER PRIMARY KEY, geom POLYGON, lane_group_fid INTEGER, lane_fid INTEGER,
  lane_index MEDIUMINT, left_boundary_fid INTEGER, right_boundary_fid INTEGER, speed_limit_mps REAL);
CREATE TABLE lane_connectors (fid INTEGER PRIMARY KEY, geom LINESTRING, exit_lane_fid INTEGER, entry_lane_fid INTEGER,
  traffic_light_stop_line_fids TEXT, speed_limit_mps REAL);
CREATE TABLE gen_lane_connectors_scaled_width_polygons (fid INTEGER PRIMARY KEY, geom POLYGON,
  lane_connector_fid INTEGER, left_boundary_fid INTEGER, right_boundary_fid INTEGER);
CREATE TABLE stop_polygons (fid INTEGER PRIMARY KEY, geom POLYGON, stop_polygon_type_fid INTEGER, lane_fids TEXT,
  lane_connector_fids TEXT);
CREATE TABLE crosswalks (fid INTEGER PRIMARY KEY, geom POLYGON, is_marked BOOLEAN);
"""
UTM = 32611  # zone 11 north, where Las Vegas lies


def blob(points: np.ndarray, *, area: bool = False, srs: int = UTM, envelope: bool = True) -> bytes:
    """A GeoPackage geometry: header, envelope, well-known binary."""
    low, high = points.min(axis=0), points.max(axis=0)
    box = struct.pack("<4d", low[0], high[0], low[1], high[1]) if envelope else b""
    header = b"GP\x00" + bytes([1 | (1 << 1 if envelope else 0)]) + struct.pack("<i", srs)
    body = struct.pack("<I", len(points)) + points.astype("<f8").tobytes()
    kind = struct.pack("<BI", 1, 3 if area else 2) + (struct.pack("<I", 1) if area else b"")
    return header + box + kind + body


def write_map(
    root: Path, *, place: Callable[[np.ndarray], np.ndarray] = lambda p: p, srs: int = UTM, damage: str = ""
) -> Path:
    """The lanes of the world: 21 and 23 lead by the connectors 49585 and 49586 to 22 and 24; a light at x = 50."""
    file = root / "maps" / "us-nv-las-vegas-strip" / "9.15.1915" / "map.gpkg"
    file.parent.mkdir(parents=True)

    def shape(points: np.ndarray, *, area: bool = False) -> bytes:
        return blob(place(points), area=area, srs=srs)

    def cut(name: str, start: float, stop: float) -> np.ndarray:
        y = LANES[name][0, 1]
        return np.array([[start, y - ORIGIN[1]], [(start + stop) / 2, y - ORIGIN[1]], [stop, y - ORIGIN[1]]]) + ORIGIN

    with closing(sqlite3.connect(file)) as db:
        db.executescript(MAP_SCHEMA)
        insert(db, "meta", (1, "projectedCoordSystem", f"EPSG:{UTM}"))
        tables = ("boundaries", "baseline_paths", "lanes_polygons", "lane_connectors", "stop_polygons", "crosswalks")
        for table in tables:
            insert(db, "gpkg_geometry_columns", (table, "geom", "", srs))
        for name, line in LINES.items():
            insert(db, "boundaries", (int(name), shape(line[::-1] if name == "33" else line), 0))
        pieces = {"21": (-60, 50), "23": (-60, 50), "22": (70, 160), "24": (70, 160)}
        for name, (start, stop) in pieces.items():
            centre = cut(name, start, stop)
            right, left = ("31", "32") if name in ("21", "22") else ("32", "33")
            group = 900 if start < 0 else 901
            insert(db, "baseline_paths", (int(name), shape(centre), 0, int(name), None))
            limit = SPEED_LIMIT_MPS if start < 0 else None
            row = (int(name), shape(centre, area=True), group, int(name), 0, int(left), int(right), limit)
            insert(db, "lanes_polygons", row)
        for fid, before, after in ((49585, "21", "22"), (49586, "23", "24")):
            centre = cut(before, 50, 70)
            insert(db, "baseline_paths", (fid, shape(centre), 0, None, fid))
            insert(db, "lane_connectors", (fid, shape(centre), int(before), int(after), "71,72", None))
            right, left = (31, 32) if before == "21" else (32, 33)
            insert(db, "gen_lane_connectors_scaled_width_polygons", (fid, None, fid, left, right))
        stop = np.array([[47.0, -1.7], [49.0, -1.7], [49.0, 5.2], [47.0, 5.2]]) + ORIGIN
        insert(db, "stop_polygons", (71, shape(stop, area=True), 2, "21,23", "49585"))
        insert(db, "crosswalks", (1, shape(CROSSWALK, area=True), 1))
        if damage:
            db.executescript(damage)
        db.commit()
    return file


def insert(db: sqlite3.Connection, table: str, row: tuple[Any, ...]) -> None:
    """One row."""
    db.execute(f"INSERT INTO {table} VALUES ({','.join('?' * len(row))})", row)


def sample(folder: Path) -> Path:
    """A log of 10 s, and the map of its city."""
    write(folder)
    write_map(folder)
    return folder


COLUMNS = {
    "lidar_pc": ("timestamp", "ego_pose_token", "token"),
    "ego_pose": ("timestamp", "x", "y", "qw", "qz", "vx"),
    "track": ("length", "width", "category_token", "token"),
    "lidar_box": ("x", "y", "vx", "vy", "yaw", "track_token", "lidar_pc_token"),
    "traffic_light_status": ("lane_connector_id", "status", "lidar_pc_token"),
    "log": ("location",),
    "category": ("name",),
}

MAP_COLUMNS = {
    "meta": ("value",), "gpkg_geometry_columns": ("srs_id", "table_name"), "boundaries": ("geom", "fid"),
    "baseline_paths": ("geom", "lane_fid", "lane_connector_fid"),
    "lanes_polygons": ("lane_fid", "left_boundary_fid", "right_boundary_fid", "speed_limit_mps", "lane_group_fid"),
    "lane_connectors": ("fid", "exit_lane_fid", "entry_lane_fid", "traffic_light_stop_line_fids", "speed_limit_mps"),
    "gen_lane_connectors_scaled_width_polygons": ("lane_connector_fid", "left_boundary_fid", "right_boundary_fid"),
    "stop_polygons": ("geom", "lane_fids", "stop_polygon_type_fid", "fid"), "crosswalks": ("geom", "fid"),
}  # fmt: skip


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage a column of the log or, one time in three, of the map, in some rows or all."""
    on_map = rng.random() < 1 / 3
    file = next(folder.rglob("*.gpkg")) if on_map else next(folder.glob("*.db"))
    columns = MAP_COLUMNS if on_map else COLUMNS
    table = list(columns)[rng.integers(len(columns))]
    column = columns[table][rng.integers(len(columns[table]))]
    value = ("NULL", "'abc'", "1e308", "-1", "9e999", "x'00ff'", f"{column} * {rng.choice(FACTORS)}", "0", "''")[
        rng.integers(9)
    ]
    where = "" if rng.random() < 0.5 else f"WHERE rowid % {rng.integers(2, 50)} = 0"
    commands = (
        f"UPDATE OR REPLACE {table} SET {column} = {value} {where}",
        f"DELETE FROM {table} WHERE rowid % {rng.integers(1, 5)} = 0",
        f"DROP TABLE {table}",
        f"ALTER TABLE {table} RENAME TO gone; CREATE VIEW {table} AS SELECT * FROM gone",
        f"INSERT INTO lidar_box SELECT randomblob(8), lidar_pc_token, track_token, x + {rng.choice([0, 9])}, y, z, "
        "width, length, height, vx, vy, vz, yaw, confidence FROM lidar_box LIMIT 50",
    )
    with closing(sqlite3.connect(file)) as db:
        try:
            db.executescript(commands[rng.choice(5, p=[0.7, 0.1, 0.05, 0.05, 0.1])])
        except sqlite3.Error:
            db.rollback()
        db.commit()
