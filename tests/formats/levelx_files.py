"""Recordings in the formats of levelXData, written by the tests after the data sets' format pages."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stylesim.tracks import AgentKind
from tests.formats import lanelet2_files
from tests.formats.traffic import Row, rows, text

UTM = (293486.1, 5628985.4)
TRACKS = (
    "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,xAcceleration,"
    "yAcceleration,lonVelocity,latVelocity,lonAcceleration,latAcceleration"
)
LANES = ",lonLaneletPos,latLaneCenterOffset,laneWidth,laneletId,laneChange"
META = "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class"
RECORDING = (
    "recordingId,locationId,frameRate,speedLimit,weekday,startTime,duration,numTracks,numVehicles,numVRUs,"
    "latLocation,lonLocation,xUtmOrigin,yUtmOrigin,orthoPxToMeter"
)
CLASSES = {
    "ind": {AgentKind.CAR: "car", AgentKind.TRUCK: "truck_bus", AgentKind.PEDESTRIAN: "pedestrian"},
    "round": {AgentKind.CAR: "car", AgentKind.TRUCK: "truck", AgentKind.PEDESTRIAN: "pedestrian"},
    "exid": {AgentKind.CAR: "car", AgentKind.TRUCK: "truck"},
}


def table(name: str, *, dt_s: float = 0.04, n_frames: int = 250) -> list[Row]:
    found = rows(n_frames=n_frames, dt_s=dt_s)
    return [r for r in found if r.kind in CLASSES[name]]


def _line(r: Row, number: int, lanes: bool) -> tuple[object, ...]:
    people = r.kind == AgentKind.PEDESTRIAN
    size = (0.0, 0.0) if people else (r.width, r.length)
    heading = float(np.degrees(r.heading)) % 360
    lon = float(np.hypot(r.vx, r.vy))
    base = (number, r.agent, r.frame, 0, r.x, r.y, heading, *size, r.vx, r.vy, 0.0, 0.0, lon, 0.0, 0.0, 0.0)
    return (*base, "1.0;2.0", "0.1;0.2", "3.5;3.5", "1001;1002", 0) if lanes else base


def write(folder: Path, name: str, *, number: int = 7, location: int = 1, rate: int = 25, **options: float) -> Path:
    """The three files of one recording."""
    folder.mkdir(parents=True, exist_ok=True)
    found = table(name, dt_s=1 / rate, **options)  # type: ignore[arg-type]
    lanes = name == "exid"
    lines = [_line(r, number, lanes) for r in found]
    (folder / f"{number:02d}_tracks.csv").write_text(text(TRACKS + (LANES if lanes else ""), lines))
    first = {r.agent: r for r in reversed(found)}
    meta = [(number, a, r.frame, 0, 0, r.width, r.length, CLASSES[name][r.kind]) for a, r in sorted(first.items())]
    (folder / f"{number:02d}_tracksMeta.csv").write_text(text(META, meta))
    numbers = (number, location, float(rate), 13.89, "tuesday", 9, 10.0, 7, 6, 1, 50.78, 6.07, *UTM, 0.0126)
    (folder / f"{number:02d}_recordingMeta.csv").write_text(text(RECORDING, [numbers]))
    return folder


def near_utm(x: float, y: float) -> tuple[float, float]:
    """Latitude and longitude of x, y metres from the UTM origin: by Newton's steps on the projection itself."""
    from stylesim.datasets.maps.projection import utm

    place = np.array([50.78, 6.07])
    for _ in range(6):
        here = utm(place[:1], place[1:], zone=32)[0]
        north = utm(place[:1] + 1e-5, place[1:], zone=32)[0]
        east = utm(place[:1], place[1:] + 1e-5, zone=32)[0]
        jacobian = np.stack([(north - here) / 1e-5, (east - here) / 1e-5], axis=1)
        place = place + np.linalg.solve(jacobian, np.array([UTM[0] + x, UTM[1] + y]) - here)
    return float(place[0]), float(place[1])


def write_map(root: Path, *, location: int = 1) -> Path:
    """The lanelet2 map of a location."""
    (root / "maps" / "lanelets").mkdir(parents=True)
    return lanelet2_files.write(root / "maps" / "lanelets" / f"location{location}.osm", near_utm)


def sample(root: Path, name: str) -> Path:
    """A data set with one recording, its map, a damaged row and one of an unknown track."""
    data = write(root / "data", name)
    with (data / "07_tracks.csv").open("a") as file:
        tail = ",1;1,1;1,1;1,1;1,0" if name == "exid" else ""
        file.write(f"7,1,x,0,0,0,0,1.8,4.3,9,0,0,0,9,0,0,0{tail}\n7,999,3,0,0,0,0,1.8,4.3,9,0,0,0,9,0,0,0{tail}\n")
    write_map(root)
    return root
