"""Logs of nuPlan (SQLite), written by the tests with the tables that a reader of tracks needs."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from tests.formats.mutations import FACTORS
from tests.formats.world import World

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


def insert(db: sqlite3.Connection, table: str, row: tuple[Any, ...]) -> None:
    """One row."""
    db.execute(f"INSERT INTO {table} VALUES ({','.join('?' * len(row))})", row)


def sample(folder: Path) -> Path:
    """A log of 10 s."""
    write(folder)
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


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage a column, in some rows or all."""
    file = next(folder.glob("*.db"))
    table = list(COLUMNS)[rng.integers(len(COLUMNS))]
    column = COLUMNS[table][rng.integers(len(COLUMNS[table]))]
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
