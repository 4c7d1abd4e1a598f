"""The relational tables of nuScenes (schema of its devkit's documentation), packed into arrays scene by scene."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.datasets.guarding import reading
from stylesim.datasets.json_stream import objects
from stylesim.errors import InputError

LIDAR = "LIDAR_TOP"  # samples are taken when it is; its pose is that of the vehicle at a sample


@dataclass(frozen=True)
class SceneRecord:
    """One scene: its samples in time, its log, and rows of it that have no sample or instance."""

    token: str
    name: str
    location: str
    logfile: str
    samples: tuple[int, ...]  # indices into Tables.time_us and Tables.pose


@dataclass(eq=False)
class Tables:
    """Everything of one version of the data set."""

    scenes: list[SceneRecord] = field(default_factory=list)
    time_us: Float64[np.ndarray, " sample"] = field(default_factory=lambda: np.zeros(0))
    pose: Float64[np.ndarray, "sample 6"] = field(default_factory=lambda: np.zeros((0, 6)))  # x, y, quaternion
    sample: Int64[np.ndarray, " row"] = field(default_factory=lambda: np.zeros(0, np.int64))  # of each annotation
    instance: Int64[np.ndarray, " row"] = field(default_factory=lambda: np.zeros(0, np.int64))
    numbers: Float64[np.ndarray, "row 8"] = field(default_factory=lambda: np.zeros((0, 8)))
    instance_id: list[str] = field(default_factory=list)
    category_of: dict[str, str] = field(default_factory=dict)  # by instance
    orphans: int = 0  # annotations of an unknown sample or instance


def tables_of(folder: Path) -> Tables:
    """The tables in a version's folder (v1.0-mini, v1.0-trainval, v1.0-test).

    InputError naming the file that is missing or damaged, or where a scene's samples are not a chain.
    """
    result = Tables()
    sample_index = _samples(folder, result)
    _poses(folder, result, sample_index)
    _annotations(folder, result, sample_index)
    return result


@contextmanager
def _table(folder: Path, name: str) -> Iterator[Iterator[dict[str, Any]]]:
    """The rows of a table; what a damaged one makes the block raise becomes an error that names it."""
    file = folder / f"{name}.json"
    with reading(file, f"table {name} of nuScenes"):
        yield objects(file)


def _indexed(folder: Path, name: str, value: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
    """Token -> value of every row."""
    result: dict[str, Any] = {}
    with _table(folder, name) as rows:
        for row in rows:
            token = str(row["token"])
            if token in result:
                raise ValueError(f"the token {token} is there twice")
            result[token] = value(row)
    return result


def _samples(folder: Path, result: Tables) -> dict[str, int]:
    logs = _indexed(folder, "log", lambda r: (str(r["location"]), str(r["logfile"])))
    rows = _indexed(
        folder, "sample", lambda r: (float(r["timestamp"]), str(r["scene_token"]), str(r["next"]), str(r["prev"]))
    )
    index = {token: i for i, token in enumerate(rows)}
    result.time_us = np.array([row[0] for row in rows.values()], np.float64)
    file = folder / "scene.json"
    with reading(file, "table scene of nuScenes"):
        for scene in objects(file):
            chain: list[int] = []
            token = str(scene["first_sample_token"])
            while token:
                if token not in rows or rows[token][1] != str(scene["token"]) or len(chain) > len(rows):
                    raise InputError(f"{file}: the samples of {scene['name']} are no chain; a table is damaged")
                chain.append(index[token])
                token = rows[token][2]
            if not chain:
                raise InputError(f"{file}: {scene['name']} has no sample; a table is damaged")
            location, logfile = logs[str(scene["log_token"])]
            result.scenes.append(SceneRecord(str(scene["token"]), str(scene["name"]), location, logfile, tuple(chain)))
    held = sum(len(scene.samples) for scene in result.scenes)
    if held != len(rows):
        raise InputError(f"{folder}: {len(rows) - held} samples belong to no scene's chain; a table is damaged")
    return index


def _poses(folder: Path, result: Tables, sample_index: dict[str, int]) -> None:
    """The pose of the vehicle at each sample: that of the lidar's key frame."""
    wanted: dict[str, int] = {}
    with _table(folder, "sample_data") as rows:
        for row in rows:
            key = row["is_key_frame"] is True and LIDAR in str(row["filename"])
            if key and str(row["sample_token"]) in sample_index:
                wanted[str(row["ego_pose_token"])] = sample_index[str(row["sample_token"])]
    result.pose = np.full((len(sample_index), 6), np.nan)
    with _table(folder, "ego_pose") as rows:
        for row in rows:
            at = wanted.get(str(row["token"]))
            if at is not None:
                result.pose[at] = (*row["translation"][:2], *row["rotation"])


def _annotations(folder: Path, result: Tables, sample_index: dict[str, int]) -> None:
    categories = _indexed(folder, "category", lambda r: str(r["name"]))
    instances = _indexed(folder, "instance", lambda r: categories.get(str(r["category_token"]), ""))
    result.instance_id, result.category_of = list(instances), instances
    number = {token: i for i, token in enumerate(instances)}
    samples, owners, values = array("q"), array("q"), array("d")
    with _table(folder, "sample_annotation") as rows:
        for row in rows:
            sample, owner = sample_index.get(str(row["sample_token"])), number.get(str(row["instance_token"]))
            if sample is None or owner is None:
                result.orphans += 1
                continue
            numbers = (*row["translation"][:2], *row["size"][:2], *row["rotation"])
            if len(numbers) != 8:
                raise ValueError(f"{row['token']} has {len(numbers)} numbers, not 8")
            samples.append(sample)
            owners.append(owner)
            values.extend(float(n) for n in numbers)
    order = np.argsort(np.frombuffer(samples, np.int64), kind="stable") if len(samples) else np.zeros(0, np.int64)
    result.sample = np.array(samples, np.int64)[order]
    result.instance = np.array(owners, np.int64)[order]
    result.numbers = np.array(values, np.float64).reshape(-1, 8)[order]
