"""Zarr folders of the Lyft data set, written by the tests."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.datasets.lyft_lights import FACE
from stylesim.datasets.lyft_records import AGENT, FRAME, SCENE
from tests.formats.mutations import mutated_array
from tests.formats.proto_writer import integer, message, packed, single, varint
from tests.formats.world import CROSSWALK, ORIGIN, SPEED_LIMIT_MPS, World

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


# Where the world's ORIGIN lies on Earth: a place in Palo Alto, in the 1e-7 degrees that the map stores.
LAT_E7, LNG_E7 = 374_200_000, -1_221_500_000


def earth(latitude_deg: float, longitude_deg: float, height_m: float = 0.0) -> np.ndarray:
    """Earth-centred coordinates of a place on WGS 84."""
    a, b = 6378137.0, 6356752.314245
    phi, lam = np.radians([latitude_deg, longitude_deg])
    n = a**2 / np.hypot(a * np.cos(phi), b * np.sin(phi))
    around = (n + height_m) * np.cos(phi)
    return np.array([around * np.cos(lam), around * np.sin(lam), ((b / a) ** 2 * n + height_m) * np.sin(phi)])


def axes(latitude_deg: float, longitude_deg: float) -> np.ndarray:
    """East, north and up there, as columns: the directions in which the place moves with its coordinates."""
    place = (latitude_deg, longitude_deg, 0.0)
    steps = [np.subtract(earth(*np.add(place, s)), earth(*np.subtract(place, s))) for s in np.diag([1e-4, 1e-4, 1.0])]
    return np.stack([step / np.linalg.norm(step) for step in (steps[1], steps[0], steps[2])], axis=-1)


def world_to_earth() -> np.ndarray:
    """The matrix of meta.json: the world's x is east and its y north at ORIGIN."""
    matrix = np.eye(4)
    matrix[:3, :3] = axes(LAT_E7 / 1e7, LNG_E7 / 1e7)
    matrix[:3, 3] = earth(LAT_E7 / 1e7, LNG_E7 / 1e7) - matrix[:3, :3] @ [*ORIGIN, 0.0]
    return matrix


def ident(number: int, *names: str) -> bytes:
    """Fields of GlobalId."""
    return b"".join(message(number, message(1, name.encode())) for name in names)


def zigzag(number: int, metres: np.ndarray) -> bytes:
    """Differences in centimetres as a packed field of sint32."""
    deltas = np.diff(np.round(metres * 100).astype(int), prepend=0)
    return packed(number, [int(d) * 2 if d >= 0 else -int(d) * 2 - 1 for d in deltas])


def frame(north_m: float = 0.0, bearing_deg: float = 0.0) -> tuple[bytes, Any]:
    """A GeoFrame so far north of ORIGIN, and from points of the world to its own."""
    lat = LAT_E7 + round(north_m / 111_000 * 1e7)
    origin = varint(1 << 3 | 5) + struct.pack("<i", lat) + varint(2 << 3 | 5) + struct.pack("<i", LNG_E7)
    content = message(1, origin) + (single(2, bearing_deg) if bearing_deg else b"")
    c, s = np.cos(np.radians(bearing_deg)), np.sin(np.radians(bearing_deg))
    to_frame = np.linalg.inv(axes(lat / 1e7, LNG_E7 / 1e7)), earth(lat / 1e7, LNG_E7 / 1e7)

    def own(points: np.ndarray) -> np.ndarray:
        matrix = world_to_earth()
        there = np.c_[points, np.zeros(len(points))] @ matrix[:3, :3].T + matrix[:3, 3]
        east, north, _ = to_frame[0] @ (there - to_frame[1]).T
        return np.stack([c * east - s * north, s * east + c * north], axis=-1)

    return content, own


def element(name: str, kind: int, content: bytes) -> bytes:
    """A MapElement."""
    return message(2, ident(1, name) + message(2, message(kind, content)))


def lane(name: str, y: float, start: float, stop: float, *, rest: bytes, where: tuple[bytes, Any]) -> bytes:
    """A lane of 3.5 m along x, with a point every 10 m."""
    x = np.arange(start, stop + 1.0, 10.0)
    sides = [where[1](np.stack([x, np.full(len(x), y + d)], -1) + ORIGIN) for d in (1.75, -1.75)]
    bounds = [message(n, zigzag(1, side[:, 0]) + zigzag(2, side[:, 1])) for n, side in zip((3, 4), sides, strict=True)]
    return element(name, 3, message(2, where[0]) + b"".join(bounds) + rest)


def fragment() -> bytes:
    """Two lanes before a junction, one in it; a light of three faces, an arrow; a crosswalk; a cycle lane."""
    plain, turned = frame(), frame(200.0, 30.0)
    lights = ident(8, "LITE")
    faces = {"redF": 11, "yelF": 12, "grnF": 13, "arrw": 31}
    walk = turned[1](CROSSWALK)
    return b"".join([
        message(1, b"palo alto"),
        lane("aaaa", 0.0, -60, 50, where=plain,
             rest=ident(1, "segm") + ident(5, "join", "gone") + ident(6, "bbbb") + lights),
        lane("bbbb", 3.5, -60, 50, where=turned, rest=ident(1, "segm") + ident(7, "aaaa") + ident(8, "grnF", "redF")),
        lane("join", 0.0, 50, 160, where=turned, rest=ident(1, "junc")),
        lane("bike", -4.0, -60, 160, where=plain, rest=message(11, integer(1, 4))),
        element("bare", 3, ident(1, "segm")),
        element("segm", 1, single(9, SPEED_LIMIT_MPS)),
        element("junc", 5, integer(4, 1)),
        element("LITE", 4, message(29, ident(3, "redF", "yelF", "grnF"))),
        *(element(name, 4, message(kind, b"\x10\x00")) for name, kind in faces.items()),
        element("walk", 4, message(16, b"\x0a\x00") + message(2, turned[0]) + zigzag(3, walk[:, 0])
                + zigzag(4, walk[:, 1])),
    ])  # fmt: skip


def write_map(root: Path, content: bytes | None = None) -> Path:
    """`semantic_map/semantic_map.pb` and `meta.json`."""
    file = root / "semantic_map" / "semantic_map.pb"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(fragment() if content is None else content)
    (root / "meta.json").write_text(json.dumps({"world_to_ecef": world_to_earth().tolist()}))
    return file


def logged(arrays: dict[str, np.ndarray], on: Callable[[int], tuple[str, ...]]) -> dict[str, np.ndarray]:
    """The arrays with faces: those that `on` says for a frame are on, the others of the light off."""
    rows, frames = [], arrays["frames"].copy()
    for t in range(len(frames)):
        first = len(rows)
        for name in ("redF", "yelF", "grnF"):
            status = (1.0, 0.0, 0.0) if name in on(t) else (0.0, 1.0, 0.0)
            rows.append((name, "LITE", status))
        frames["traffic_light_faces_index_interval"][t] = (first, len(rows))
    return {**arrays, "frames": frames, "traffic_light_faces": np.array(rows, FACE)}


def phase(t: int) -> tuple[str, ...]:
    """Green, yellow, red, red with yellow, all off."""
    return (("grnF",), ("yelF",), ("redF",), ("redF", "yelF"), ())[min(t // 10, 4)]


def sample(folder: Path) -> Path:
    """A store with two scenes, one right after the other, and the map."""
    write_map(folder)
    write(folder, logged(records(starts_s=(0.0, 10.0)), phase))
    return folder


_RECORDS = logged(records(n_frames=40), phase)


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage a field of the records."""
    arrays = {name: values.copy() for name, values in _RECORDS.items()}
    name = ("scenes", "frames", "agents", "agents", "traffic_light_faces")[rng.integers(5)]
    field = arrays[name].dtype.names[rng.integers(len(arrays[name].dtype.names))]
    if field not in ("host", "face_id", "traffic_light_id"):
        damaged = mutated_array(arrays[name][field], rng)
        if damaged.shape == arrays[name][field].shape and damaged.dtype.kind in "fiu":
            with np.errstate(all="ignore"):
                arrays[name][field] = damaged.astype(arrays[name][field].dtype)
    shutil.rmtree(folder / "sample.zarr")
    write(folder, arrays)
