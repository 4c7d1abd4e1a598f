"""A traffic history of SMARTS, written by the tests."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

from stylesim.tracks import AgentKind
from tests.formats.traffic import Row, rows

SCHEMA = """
CREATE TABLE Spec (key TEXT PRIMARY KEY, value TEXT) WITHOUT ROWID;
CREATE TABLE Vehicle (id INTEGER PRIMARY KEY, type INTEGER NOT NULL, length REAL, width REAL, height REAL,
    is_ego_vehicle INTEGER DEFAULT 0) WITHOUT ROWID;
CREATE TABLE Trajectory (vehicle_id INTEGER NOT NULL, sim_time REAL NOT NULL, position_x REAL NOT NULL,
    position_y REAL NOT NULL, heading_rad REAL NOT NULL, speed REAL DEFAULT 0.0, lane_id INTEGER DEFAULT 0,
    PRIMARY KEY (vehicle_id, sim_time), FOREIGN KEY (vehicle_id) REFERENCES Vehicle(id)) WITHOUT ROWID;
CREATE TABLE TrafficLightState (sim_time REAL NOT NULL, state INTEGER NOT NULL, stop_point_x REAL NOT NULL,
    stop_point_y REAL NOT NULL, lane INTEGER NOT NULL);
"""
TYPES = {AgentKind.CAR: 2, AgentKind.TRUCK: 3, AgentKind.PEDESTRIAN: 4}


def write(path: Path, table: list[Row] | None = None) -> Path:
    """A history of those rows and one light."""
    table = rows() if table is None else table
    with closing(sqlite3.connect(path)) as database:
        database.executescript(SCHEMA)
        first = {r.agent: r for r in reversed(table)}
        database.executemany(
            "INSERT INTO Vehicle VALUES (?, ?, ?, ?, NULL, 0)",
            [(a, TYPES[r.kind], r.length, r.width) for a, r in sorted(first.items())],
        )
        database.executemany(
            "INSERT INTO Trajectory VALUES (?, ?, ?, ?, ?, ?, 0)",
            [
                (r.agent, round(7.9 + r.t, 1), r.x, r.y, r.heading - np.pi / 2, float(np.hypot(r.vx, r.vy)))
                for r in table
            ],
        )
        database.executemany(
            "INSERT INTO TrafficLightState VALUES (?, ?, 18.0, 0.0, 1)",
            [(7.9 + 0.1 * k, 1 + (k // 30) % 3) for k in range(120)],
        )
        database.commit()
    return path


def sample(folder: Path) -> Path:
    """One history."""
    return write(folder / "made.shf")
