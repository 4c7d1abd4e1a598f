"""A site in the format of TAF-BW, written by the tests."""

from __future__ import annotations

from pathlib import Path

from stylesim.tracks import AgentKind
from tests.formats import lanelet2_files
from tests.formats.traffic import Row, rows, text

HEADER = "track_id,frame_id,timestamp_ms,agent_type,vx,vy,psi_rad,length,width,time,x,y"
META = (
    "id,frameRate_hz,locationId,speedLimit_kmh,date,weekDay,startTime,duration,originLat,originLon,{spat},"
    "simulated,tracking,timeZone"
)
KINDS = {AgentKind.CAR: "Car", AgentKind.TRUCK: "Truck", AgentKind.PEDESTRIAN: "Pedestrian"}
ORIGIN = (49.005306, 8.4374089)
CYCLE = ("STOP_AND_REMAIN", "PRE_MOVEMENT", "PERMISSIVE_MOVEMENT_ALLOWED", "PERMISSIVE_CLEARANCE")


def write(folder: Path, starts: dict[str, str], table: list[Row] | None = None, *, spat: str = "spatAvailible") -> Path:
    """Recordings with those start times by id, map and meta data; the first has signal phases."""
    folder.mkdir(parents=True, exist_ok=True)
    table = rows() if table is None else table
    lines = [
        (r.agent, 3000 + r.frame, 100 * r.frame, KINDS[r.kind], r.vx, r.vy, r.heading, r.length, r.width, "-", r.x, r.y)
        for r in table
    ]
    meta = []
    for number, start in starts.items():
        (folder / f"vehicle_tracks_{number}.csv").write_text(text(HEADER, lines))
        meta.append((number, 10, "K1", 50, "2022-03-16", "Wed", start, 12, *map(repr, ORIGIN), "yes", "no", "on", 1))
    (folder / "meta_data.csv").write_text(text(META.format(spat=spat), meta))
    phases = [(group, 100 * k, CYCLE[(k // 20 + group) % 4]) for group in (1, 2) for k in range(120)]
    first = min(starts)
    (folder / f"signal_phases_{first}.csv").write_text(text("signal_group_id,timestamp_ms,movement_state", phases))
    return folder


def sample(folder: Path) -> Path:
    """Two recordings that follow one another and one an hour later."""
    site = write(folder / "k1_2022-03-16", {"000": "11:17:19.098", "001": "11:17:32.1", "002": "12:17:40.0"})
    lanelet2_files.write(site / "k1_2022-03-16.osm", lanelet2_files.mercator(*ORIGIN))
    return site
