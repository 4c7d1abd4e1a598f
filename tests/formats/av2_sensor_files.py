"""Argoverse 2 sensor logs, written by the tests after the documentation of the av2 package."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl

from tests.formats.av2_files import vector_map
from tests.formats.mutations import mutated_frame
from tests.formats.world import World

BEGIN_NS = 315_969_904_359_876_000
CATEGORIES = {"car": "REGULAR_VEHICLE", "cyclist": "BICYCLIST", "pedestrian": "PEDESTRIAN"}
AXLE_TO_CENTRE = 4.869 / 2 - 1.05
TURN = 0.4  # heading of the whole world, so that the frames of vehicle and city differ


def turned(points: np.ndarray) -> np.ndarray:
    """The world's places in the city: turned about its origin."""
    c, s = np.cos(TURN), np.sin(TURN)
    return points @ np.array([[c, s], [-s, c]])


def tables(n_frames: int = 60) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Annotations and poses of the world, whose car 0 is the ego vehicle."""
    w = World(n_frames=n_frames)
    stamps = [BEGIN_NS + 100_000_000 * t + 40_000 * (t % 3) for t in range(n_frames)]
    half = (np.cos(TURN / 2), np.sin(TURN / 2))
    boxes, poses = [], []
    for t in range(n_frames):
        centre = turned(w.position[0, t])
        axle = centre - np.array([np.cos(TURN), np.sin(TURN)]) * AXLE_TO_CENTRE
        pose = {"qw": half[0], "qx": 0.0, "qy": 0.0, "qz": half[1], "tx_m": axle[0], "ty_m": axle[1], "tz_m": 2.0}
        poses += [{"timestamp_ns": stamps[t], **pose}, {"timestamp_ns": stamps[t] + 30_000_000, **pose}]
        for a in range(1, len(w.id)):
            if w.valid[a, t]:
                offset = w.position[a, t] - w.position[0, t] + [AXLE_TO_CENTRE, 0.0]
                yaw = w.heading[a, t] / 2
                boxes.append(
                    {
                        "timestamp_ns": stamps[t], "track_uuid": f"uuid-{w.id[a]}", "category": CATEGORIES[w.kind[a]],
                        "length_m": w.size[a, 0], "width_m": w.size[a, 1], "height_m": 1.5,
                        "qw": np.cos(yaw), "qx": 0.0, "qy": 0.0, "qz": np.sin(yaw),
                        "tx_m": offset[0], "ty_m": offset[1], "tz_m": 0.5, "num_interior_pts": 9,
                    }
                )  # fmt: skip
    return pl.DataFrame(boxes), pl.DataFrame(poses)


def write(parent: Path, *, log: str = "log-1", n_frames: int = 60, boxes: pl.DataFrame | None = None) -> Path:
    """A log's folder in `parent`."""
    folder = parent / log
    (folder / "map").mkdir(parents=True)
    annotations, poses = tables(n_frames)
    (annotations if boxes is None else boxes).write_ipc(folder / "annotations.feather", compression="lz4")
    poses.write_ipc(folder / "city_SE3_egovehicle.feather", compression="zstd")
    (folder / "map" / f"log_map_archive_{log}____PIT_city_31785.json").write_text(json.dumps(vector_map()))
    return folder


def sample(folder: Path) -> Path:
    """A root with one log in train and one in val."""
    write(folder / "train", log="log-1")
    write(folder / "val", log="log-2", n_frames=30)
    return folder


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage the values of one table."""
    files = sorted(folder.rglob("*.feather"))
    file = files[rng.integers(len(files))]
    mutated_frame(pl.read_ipc(file.read_bytes()), rng).write_ipc(file)
