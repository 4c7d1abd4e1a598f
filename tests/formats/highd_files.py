"""A data set in the format of highD, written by the tests after its format page: an image whose y points down."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.formats.traffic import text

TRACKS = (
    "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,frontSightDistance,backSightDistance,"
    "dhw,thw,ttc,precedingXVelocity,precedingId,followingId,leftPrecedingId,leftAlongsideId,leftFollowingId,"
    "rightPrecedingId,rightAlongsideId,rightFollowingId,laneId"
)
META = "id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection,traveledDistance"
RECORDING = (
    "id,frameRate,locationId,speedLimit,month,weekDay,startTime,duration,totalDrivenDistance,totalDrivenTime,"
    "numVehicles,numCars,numTrucks,upperLaneMarkings,lowerLaneMarkings"
)
UPPER, LOWER = (8.5, 12.25, 16.0), (21.0, 24.75, 28.5)  # from above; two lanes each
LENGTH, HEIGHT = 4.6, 1.9
# Vehicle: direction (1 towards -x), y of its centre in the image, speed.
VEHICLES = {
    1: (1, 10.4, 30.0), 2: (1, 14.1, 38.0), 3: (2, 22.9, 36.0), 4: (2, 26.6, 27.0), 5: (2, 26.6, 28.0),
    6: (1, 10.4, 31.0),
}  # fmt: skip


def write(folder: Path, *, number: int = 3, n_frames: int = 250) -> Path:
    """The three files of one recording."""
    folder.mkdir(parents=True, exist_ok=True)
    lines, meta = [], []
    for vehicle, (direction, y, speed) in VEHICLES.items():
        sign = -1.0 if direction == 1 else 1.0
        for frame in range(1, n_frames + 1):
            t = frame / 25
            x = (400.0 if direction == 1 else 0.0) + 30.0 * vehicle * sign + sign * speed * t
            drift = 0.1 * np.sin(t)
            corner = (x - LENGTH / 2, y + drift - HEIGHT / 2)
            velocity = (sign * speed, 0.1 * float(np.cos(t)))
            lines.append((frame, vehicle, *corner, LENGTH, HEIGHT, *velocity, *[0.0] * 16, 2))
        kind = "Truck" if vehicle == 4 else "Car"
        meta.append((vehicle, LENGTH, HEIGHT, 1, n_frames, n_frames, kind, direction, 300.0))
    (folder / f"{number:02d}_tracks.csv").write_text(text(TRACKS, lines))
    (folder / f"{number:02d}_tracksMeta.csv").write_text(text(META, meta))
    markings = [";".join(map(str, side)) for side in (UPPER, LOWER)]
    row = (number, 25, 2, 36.11, "9.2017", "Tue", "08:38", 10.0, 900.0, 60.0, 6, 5, 1, *markings)
    (folder / f"{number:02d}_recordingMeta.csv").write_text(text(RECORDING, [row]))
    return folder


def sample(folder: Path) -> Path:
    """One recording with a damaged row."""
    write(folder / "data")
    with (folder / "data" / "03_tracks.csv").open("a") as file:
        file.write("2,1," + ",".join(["nan"] * 22) + ",2\n")
    return folder
