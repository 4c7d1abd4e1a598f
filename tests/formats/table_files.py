"""A user's own table of tracks: feet, km/h, degrees, an image's y, a clock in milliseconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.formats.traffic import Row, rows, text

HEADER = "run;who;when;center_x;center_y;v;dir;len;wid;class"
SPEC = """
columns: {id: who, time: when, x: center_x, y: center_y, speed: v, heading: dir, length: len, width: wid, kind: class,
          recording: run}
unit: feet
speed_unit: km/h
time_unit: ms
angle: degrees
y_axis: down
separator: ";"
site: made crossing
"""
FOOT = 0.3048


def lines(table: list[Row], run: str) -> list[tuple[object, ...]]:
    return [
        (
            run, r.agent, 1000.0 * r.t, r.x / FOOT, -r.y / FOOT, 3.6 * float(np.hypot(r.vx, r.vy)),
            -float(np.degrees(r.heading)), r.length / FOOT, r.width / FOOT, r.kind.name.lower(),
        )
        for r in table
    ]  # fmt: skip


def write(folder: Path, *, table: list[Row] | None = None) -> Path:
    """The table and the file that says what its columns mean."""
    folder.mkdir(parents=True, exist_ok=True)
    table = rows() if table is None else table
    path = folder / "tracks.csv"
    path.write_text(text(HEADER, [*lines(table, "monday"), *lines(table, "tuesday")], separator=";"))
    (folder / "tracks.columns.yaml").write_text(SPEC)
    return path


def sample(folder: Path) -> Path:
    """The table with a damaged row."""
    path = write(folder)
    with path.open("a") as file:
        file.write("monday;1;never;0;0;1;0;14;6;car\n")
    return path
