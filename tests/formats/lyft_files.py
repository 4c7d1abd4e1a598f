"""Zarr folders of the Lyft data set, written by the tests."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.datasets.lyft_records import AGENT, FRAME, SCENE
from tests.formats.mutations import mutated_array
from tests.formats.world import World

LABELS = [
    "PERCEPTION_LABEL_NOT_SET", "PERCEPTION_LABEL_UNKNOWN", "PERCEPTION_LABEL_DONTCARE", "PERCEPTION_LABEL_CAR",
    "PERCEPTION_LABEL_VAN", "PERCEPTION_LABEL_TRAM", "PERCEPTION_LABEL_BUS", "PERCEPTION_LABEL_TRUCK",
    "PERCEPTION_LABEL_EMERGENCY_VEHICLE", "PERCEPTION_LABEL_OTHER_VEHICLE", "PERCEPTION_LABEL_BICYCLE",
    "PERCEPTION_LABEL_MOTORCYCLE", "PERCEPTION_LABEL_CYCLIST", "PERCEPTION_LABEL_MOTORCYCLIST",
    "PERCEPTION_LABEL_PEDESTRIAN", "PERCEPTION_LABEL_ANIMAL", "AVRESEARCH_LABEL_DONTCARE",
]  # fmt: skip
OF_KIND = {"car": 3, "cyclist": 12, "pedestrian": 14}
BEGIN_NS = 1_571_846_863_319_362_048


def records(*, n_frames: int = 60, starts_s: tuple[float, ...] = (0.0,)) -> dict[str, np.ndarray]:
    """The world, seen by car 0, in one scene for each start."""
    w = World(n_frames=n_frames)
    scenes, frames, agents = [], [], []
    for start in starts_s:
        begin = BEGIN_NS + int(start * 1e9)
        scenes.append(((len(frames), len(frames) + n_frames), "host-a1", begin, begin + int((n_frames - 1) * 1e8)))
        for t in range(n_frames):
            first = len(agents)
            for a in range(1, len(w.id)):
                if w.valid[a, t]:
                    label = np.zeros(len(LABELS))
                    label[OF_KIND[w.kind[a]]] = 1.0
                    size = (*w.size[a], 1.5)
                    agents.append((w.position[a, t], size, w.heading[a, t], w.velocity[a, t], w.id[a], label))
            place = (*w.position[0, t], 1.0)
            frames.append((begin + t * 100_000_000, (first, len(agents)), (0, 0), place, np.eye(3)))
    return {"scenes": np.array(scenes, SCENE), "frames": np.array(frames, FRAME), "agents": np.array(agents, AGENT)}


def write(folder: Path, arrays: dict[str, np.ndarray], *, chunk: int = 200, packed: bool = True) -> Path:
    """A store `sample.zarr` with these arrays."""
    store = folder / "sample.zarr"
    store.mkdir(parents=True)
    (store / ".zgroup").write_text('{"zarr_format": 2}')
    (store / ".zattrs").write_text(json.dumps({"format_version": 2, "labels": LABELS}))
    for name, values in arrays.items():
        (store / name).mkdir()
        meta: dict[str, Any] = {
            "chunks": [chunk], "compressor": None, "dtype": [list(field) for field in values.dtype.descr],
            "fill_value": None, "filters": None, "order": "C", "shape": [len(values)], "zarr_format": 2,
        }  # fmt: skip
        if packed:
            meta["compressor"] = {"id": "blosc", "cname": "lz4", "clevel": 5, "shuffle": 1, "blocksize": 0}
        (store / name / ".zarray").write_text(json.dumps(meta))
        for number in range(-(-len(values) // chunk)):
            part = np.zeros(chunk, values.dtype)
            rows = values[number * chunk : (number + 1) * chunk]
            part[: len(rows)] = rows
            (store / name / str(number)).write_bytes(_packed(part) if packed else part.tobytes())
    return store


def _packed(part: np.ndarray) -> bytes:
    from numcodecs import Blosc

    return bytes(Blosc(cname="lz4", clevel=5, shuffle=1).encode(part))


def sample(folder: Path) -> Path:
    """A store with two scenes, one right after the other."""
    return write(folder, records(starts_s=(0.0, 10.0)))


_RECORDS = records(n_frames=40)


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage a field of the records."""
    arrays = {name: values.copy() for name, values in _RECORDS.items()}
    name = ("scenes", "frames", "agents", "agents")[rng.integers(4)]
    field = arrays[name].dtype.names[rng.integers(len(arrays[name].dtype.names))]
    if field != "host":
        damaged = mutated_array(arrays[name][field], rng)
        if damaged.shape == arrays[name][field].shape and damaged.dtype.kind in "fiu":
            with np.errstate(all="ignore"):
                arrays[name][field] = damaged.astype(arrays[name][field].dtype)
    for file in folder.iterdir():
        file.rename(folder / "old")
    write(folder, arrays)
    shutil.rmtree(folder / "old")
