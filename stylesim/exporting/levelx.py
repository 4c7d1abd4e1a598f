"""CSV triples as of inD, rounD and exiD (the family of highD, with headings): one recording a scene."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.exporting.base import Styles
from stylesim.scene import Scene
from stylesim.tracks import AgentKind

CLASSES = {
    AgentKind.CAR: "car", AgentKind.TRUCK: "truck", AgentKind.BUS: "bus", AgentKind.MOTORCYCLE: "motorcycle",
    AgentKind.BICYCLE: "bicycle", AgentKind.PEDESTRIAN: "pedestrian", AgentKind.STATIC: "unknown",
    AgentKind.OTHER: "unknown",
}  # fmt: skip


UTM_EASTING_M, UTM_NORTHING_M = (100_000.0, 900_000.0), 10_000_000.0  # by definition of a zone
NOWHERE_UTM_M = (500_000.0, 5_000_000.0)  # of a scene whose origin is no UTM place; chosen: in the middle of a zone


class FormatWriter:
    """`<nn>_tracks.csv`, `<nn>_tracksMeta.csv`, `<nn>_recordingMeta.csv`; maps and lights have no place in them.

    Positions are in metres from the scene's origin, which is the UTM origin where it is one. Numbers are written to
    1 mm, 0.0001 m/s and 0.0001 degrees. Styles are extra columns of the tracks' meta data.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.counts: Counter[str] = Counter()

    def add(self, scene: Scene, styles: Styles) -> None:
        """One recording."""
        if not scene.tracks.valid.any():
            self.counts["scenes_without_road_users"] += 1
            return
        number = self.counts["written"]
        name = f"{number:02d}"
        self.counts["maps_not_written"] += scene.road is not None
        self.counts["lights_not_written"] += 0 if scene.signals is None else len(scene.signals.signal_id)
        tables = {"tracks": _tracks(scene, number), "tracksMeta": _meta(scene, number, styles),
                  "recordingMeta": _recording(scene, number)}  # fmt: skip
        for kind, table in tables.items():
            table.write_csv(self._folder / f"{name}_{kind}.csv", float_precision=4)
        self.counts["written"] += 1
        self.counts["agent_frames"] += int(scene.tracks.valid.sum())

    def finish(self) -> None:
        """Nothing stands once per data set."""


def _tracks(scene: Scene, number: int) -> pl.DataFrame:
    tracks = scene.tracks
    agent, frame = np.nonzero(tracks.valid)
    first = tracks.valid.argmax(axis=1)
    place = tracks.position_m[agent, frame].astype(np.float64)
    speed = tracks.velocity_mps[agent, frame].astype(np.float64)
    turn = tracks.heading_rad[agent, frame].astype(np.float64)
    gained = np.full((*tracks.valid.shape, 2), np.nan)
    gained[:, 1:] = np.diff(tracks.velocity_mps.astype(np.float64), axis=1) / tracks.dt_s
    gained[:, 0] = gained[:, 1] if tracks.n_frames > 1 else 0.0
    push = np.nan_to_num(gained[agent, frame])
    c, s = np.cos(turn), np.sin(turn)
    size = np.nan_to_num(tracks.size_m.astype(np.float64))
    columns: dict[str, Any] = {
        "recordingId": np.full(len(agent), number), "trackId": agent, "frame": frame,
        "trackLifetime": frame - first[agent], "xCenter": place[:, 0], "yCenter": place[:, 1],
        "heading": np.degrees(turn) % 360.0, "width": size[agent, 1], "length": size[agent, 0],
        "xVelocity": speed[:, 0], "yVelocity": speed[:, 1], "xAcceleration": push[:, 0], "yAcceleration": push[:, 1],
        "lonVelocity": c * speed[:, 0] + s * speed[:, 1], "latVelocity": c * speed[:, 1] - s * speed[:, 0],
        "lonAcceleration": c * push[:, 0] + s * push[:, 1], "latAcceleration": c * push[:, 1] - s * push[:, 0],
    }  # fmt: skip
    return pl.DataFrame(columns)


def _meta(scene: Scene, number: int, styles: Styles) -> pl.DataFrame:
    tracks = scene.tracks
    seen = np.flatnonzero(tracks.valid.any(axis=1))
    first = tracks.valid[seen].argmax(axis=1)
    last = tracks.n_frames - 1 - tracks.valid[seen, ::-1].argmax(axis=1)
    size = np.nan_to_num(tracks.size_m[seen].astype(np.float64))
    columns: dict[str, Any] = {
        "recordingId": np.full(len(seen), number), "trackId": seen, "initialFrame": first, "finalFrame": last,
        "numFrames": last - first + 1, "width": size[:, 1], "length": size[:, 0],
        "class": [CLASSES[AgentKind(int(tracks.kind[i]))] for i in seen],
        "agentId": [tracks.agent_id[i] for i in seen],
    }  # fmt: skip
    for column in sorted({key for found in styles.values() for key in found}):
        columns[column] = [styles.get(tracks.agent_id[i], {}).get(column) for i in seen]
    return pl.DataFrame(columns)


def _recording(scene: Scene, number: int) -> pl.DataFrame:
    tracks = scene.tracks
    limits = [lane.speed_limit_mps for lane in scene.road.lanes] if scene.road is not None else []
    known = [x for x in limits if np.isfinite(x)]
    motor = int((tracks.is_motor & tracks.valid.any(axis=1)).sum())
    everybody = int(tracks.valid.any(axis=1).sum())
    x, y = tracks.origin_m.tolist()
    utm = (x, y) if UTM_EASTING_M[0] <= x <= UTM_EASTING_M[1] and 0 <= y <= UTM_NORTHING_M else NOWHERE_UTM_M
    row: dict[str, Any] = {
        "recordingId": number, "locationId": 0, "frameRate": 1.0 / tracks.dt_s,
        "speedLimit": float(np.median(known)) if known else -1.0, "weekday": "", "startTime": "",
        "duration": tracks.n_frames * tracks.dt_s, "numTracks": everybody, "numVehicles": motor,
        "numVRUs": everybody - motor, "latLocation": 0.0, "lonLocation": 0.0,
        "xUtmOrigin": utm[0], "yUtmOrigin": utm[1],
        "orthoPxToMeter": 0.1, "scene": scene.scene_id,
    }  # fmt: skip
    return pl.DataFrame([row])
