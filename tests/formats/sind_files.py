"""A recording in the format of SinD, written by the tests after its Format.md."""

from __future__ import annotations

from pathlib import Path

from stylesim.tracks import AgentKind
from tests.formats import lanelet2_files
from tests.formats.traffic import Row, rows, text

VEHICLES = (
    "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,yaw_rad,heading_rad,length,width,ax,ay,v_lon,v_lat,a_lon,a_lat"
)
PEOPLE = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,ax,ay"
STEP_MS = 3000 / 29.97
LIGHTS = "RawFrameID,timestamp(ms),Traffic light 1,Traffic light 2"
KINDS = {AgentKind.CAR: "car", AgentKind.TRUCK: "truck", AgentKind.PEDESTRIAN: "pedestrian"}


def write(folder: Path, table: list[Row] | None = None, *, lights: list[tuple[float, int, int]] | None = None) -> Path:
    """A recording's folder; lights are (seconds, state of light 1, state of light 2)."""
    folder.mkdir(parents=True, exist_ok=True)
    table = rows(dt_s=STEP_MS / 1000) if table is None else table
    cars, people = [], []
    for r in table:
        head = (r.frame, round(r.frame * STEP_MS, 9), KINDS[r.kind], r.x, r.y, r.vx, r.vy)
        if r.kind == AgentKind.PEDESTRIAN:
            people.append((f"P{r.agent}", *head, 0.0, 0.0))
        else:
            tail = (r.length, r.width, 0.0, 0.0, r.vx, r.vy, 0.0, 0.0)
            cars.append((r.agent, *head, r.heading, r.heading, *tail))
    (folder / "Veh_smoothed_tracks.csv").write_text(text(VEHICLES, cars))
    (folder / "Ped_smoothed_tracks.csv").write_text(text(PEOPLE, people))
    shown = [(-4.0, 0, 1), (5.0, 0, 3), (8.0, 1, 0)] if lights is None else lights
    log = [(int(t * 29.97), 1000.0 * t, one, two) for t, one, two in shown]
    (folder / f"TrafficLight_{folder.name}.csv").write_text(text(LIGHTS, log))
    return folder


def sample(folder: Path) -> Path:
    """One recording with its map in the folder above, and a damaged row."""
    recording = write(folder / "8_2_1")
    with (recording / "Veh_smoothed_tracks.csv").open("a") as file:
        file.write("1,3,nan,car,0,0,9,0,0,0,4.3,1.8,0,0,9,0,0,0\n")
    lanelet2_files.write(folder / "map.osm")
    return folder
