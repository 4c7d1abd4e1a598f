"""TFRecord files of Waymo Open Motion, written by the tests: `Scenario` protos and `tf.Example`."""

from __future__ import annotations

import copy
import struct
from pathlib import Path
from typing import Any

import numpy as np

from tests.formats.mutations import mutated_tree
from tests.formats.proto_writer import double, integer, message, packed, record, single
from tests.formats.world import CROSSWALK, LANES, LEFT, LINES, SPEED_LIMIT_MPS, STOP, SUCCESSORS, World

TYPES = {"car": 1, "pedestrian": 2, "cyclist": 3}
NAME = "training.tfrecord-00000-of-00001"


def tree(scenario_id: str = "abc", n_frames: int = 91) -> dict[str, Any]:
    """The scenario as plain values, to be damaged or encoded."""
    w = World(n_frames=n_frames)
    return {
        "id": scenario_id,
        "t0": 10,
        "times": [0.1 * i for i in range(n_frames)],
        "tracks": [
            {
                "id": w.id[a],
                "type": TYPES[w.kind[a]],
                "states": [
                    [*w.position[a, t].tolist(), 5.0, *w.size[a].tolist(), 1.5, w.heading[a, t], *w.velocity[a, t], 1]
                    if w.valid[a, t]
                    else None
                    for t in range(n_frames)
                ],
            }
            for a in range(len(w.id))
        ],
        "lights": [[[21, 4 if t < 40 else 6, STOP.tolist()]] for t in range(n_frames)],
        "lanes": {
            key: {"line": line.tolist(), "mph": SPEED_LIMIT_MPS / 0.44704, "exits": [int(s) for s in SUCCESSORS[key]]}
            for key, line in LANES.items()
        },
        "lines": {key: line.tolist() for key, line in LINES.items()},
        "crosswalk": CROSSWALK.tolist(),
        "ego": 0,
        "predict": [1],
    }


def _point(number: int, xy: Any) -> bytes:
    return message(number, double(1, xy[0]) + double(2, xy[1]) + double(3, 4.5))


def _state(values: Any) -> bytes:
    if values is None:
        return integer(11, 0)
    out = b"".join(double(i + 2, values[i]) for i in range(3))
    out += b"".join(single(i + 2, values[i]) for i in range(3, 9))
    return out + integer(11, values[9])


def scenario(t: dict[str, Any]) -> bytes:
    """The tree as a `Scenario` proto."""
    out = b"".join(double(1, x) for x in t["times"])
    for track in t["tracks"]:
        states = b"".join(message(3, _state(s)) for s in track["states"])
        out += message(2, integer(1, track["id"]) + integer(2, track["type"]) + states)
    out += message(5, t["id"].encode()) + integer(6, t["ego"])
    for entries in t["lights"]:
        lanes = b"".join(message(1, integer(1, e[0]) + integer(2, e[1]) + _point(3, e[2])) for e in entries)
        out += message(7, lanes)
    beside = {"21": ("32", "31"), "22": ("32", "31"), "23": ("33", "32"), "24": ("33", "32")}
    for key, lane in t["lanes"].items():
        n = len(lane["line"])
        body = double(1, lane["mph"]) + integer(2, 2) + b"".join(_point(8, p) for p in lane["line"])
        body += packed(10, lane["exits"])
        for number, line in zip((13, 14), beside[key], strict=True):
            body += message(number, integer(1, 0) + integer(2, n - 1) + integer(3, int(line)))
        if key in LEFT:
            body += message(11, integer(1, int(LEFT[key])) + integer(2, 0) + integer(3, n - 1))
        out += message(8, integer(1, int(key)) + message(3, body))
    for key, line in t["lines"].items():
        out += message(8, integer(1, int(key)) + message(4, integer(1, 1) + b"".join(_point(2, p) for p in line)))
    out += message(8, integer(1, 41) + message(8, b"".join(_point(1, p) for p in t["crosswalk"])))
    out += message(8, integer(1, 42) + message(7, packed(1, [21]) + _point(2, t["crosswalk"][0])))
    out += integer(10, t["t0"])
    return out + b"".join(message(11, integer(1, i) + integer(2, 1)) for i in t["predict"])


def _feature(name: str, values: Any) -> bytes:
    if isinstance(values, bytes):
        value = message(1, message(1, values))
    elif np.asarray(values).dtype.kind == "f":
        with np.errstate(over="ignore"):
            value = message(2, message(1, np.asarray(values, "<f4").tobytes()))
    else:
        value = message(3, packed(1, np.asarray(values).reshape(-1).tolist()))
    return message(1, message(1, name.encode()) + message(2, value))


def example(t: dict[str, Any]) -> bytes:
    """The tree as a `tf.Example` (of fewer agents and road points than the real ones are padded to)."""
    empty = [-1.0] * 9 + [0]
    states = np.array([[empty if s is None else s for s in track["states"]] for track in t["tracks"]], float)
    ids = [float(track["id"]) for track in t["tracks"]]
    out = _feature("scenario/id", t["id"].encode()) + _feature("state/id", np.array([*ids, -1.0]))
    out += _feature("state/type", np.array([*(float(track["type"]) for track in t["tracks"]), -1.0]))
    out += _feature("state/is_sdc", np.array([1] + [0] * len(ids)))
    out += _feature("state/tracks_to_predict", np.array([0, 1] + [0] * (len(ids) - 1)))
    names = {"x": 0, "y": 1, "z": 2, "length": 3, "width": 4, "height": 5, "bbox_yaw": 6, "velocity_x": 7,
             "velocity_y": 8}  # fmt: skip
    padded = np.concatenate([states, np.full((1, *states.shape[1:]), -1.0)])
    for when, cut in (("past", slice(0, 10)), ("current", slice(10, 11)), ("future", slice(11, 91))):
        for name, column in names.items():
            out += _feature(f"state/{when}/{name}", padded[:, cut, column].reshape(-1))
        out += _feature(f"state/{when}/valid", (padded[:, cut, 9] > 0).astype(int))
        stamps = np.broadcast_to((np.array(t["times"])[cut] * 1e6).astype(int), padded[:, cut, 0].shape)
        out += _feature(f"state/{when}/timestamp_micros", np.where(padded[:, cut, 9] > 0, stamps, -1))
        lights = [[*e[0][:2], *e[0][2]] for e in t["lights"][cut]]
        for name, column in (("id", 0), ("state", 1), ("x", 2), ("y", 3)):
            values = np.array([row[column] for row in lights])
            out += _feature(f"traffic_light_state/{when}/{name}", values if column < 2 else values.astype(float))
        out += _feature(f"traffic_light_state/{when}/valid", np.ones(len(lights), int))
    roads = [(key, 2, lane["line"]) for key, lane in t["lanes"].items()] + [("41", 18, t["crosswalk"])]
    xyz = np.array([[*p, 4.5] for _, _, line in roads for p in line] + [[-1.0, -1.0, -1.0]], float)
    out += _feature("roadgraph_samples/xyz", xyz.reshape(-1))
    out += _feature("roadgraph_samples/id", np.array([int(k) for k, _, line in roads for _ in line] + [-1]))
    out += _feature("roadgraph_samples/type", np.array([kind for _, kind, line in roads for _ in line] + [-1]))
    out += _feature("roadgraph_samples/valid", np.array([1] * (len(xyz) - 1) + [0]))
    return message(1, out)


def write(folder: Path, *contents: bytes, name: str = NAME) -> Path:
    """A TFRecord file of these records."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / name
    file.write_bytes(b"".join(record(content) for content in contents))
    return file


def sample(folder: Path) -> Path:
    """One file with two scenarios, one with an example."""
    write(folder, scenario(tree("a")), scenario(tree("b")))
    write(folder, example(tree("c")), name="validation_tfexample.tfrecord-00000-of-00001")
    return folder


_TREE = tree("a")


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage a value, or a byte under a checksum that is right."""
    kind = rng.integers(3)
    if kind == 2:
        content = bytearray(scenario(_TREE) if rng.random() < 0.5 else example(_TREE))
        for place in rng.integers(len(content), size=int(rng.integers(1, 9))).tolist():
            content[place] ^= 1 << int(rng.integers(8))
        write(folder, bytes(content))
        return
    for _ in range(20):  # values that no writer can encode are no files
        try:
            damaged = mutated_tree(copy.deepcopy(_TREE), rng)
            with np.errstate(all="ignore"):
                write(folder, (scenario if kind == 0 else example)(damaged))
            return
        except (TypeError, ValueError, KeyError, IndexError, AttributeError, struct.error, OverflowError):
            continue
