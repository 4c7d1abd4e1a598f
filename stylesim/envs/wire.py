"""The bytes between an environment and the child that holds its simulation. No pickle: structs, arrays and JSON.

A message is its length (u32), a kind (one byte) and a body. Bodies of steps are fixed structs and raw little-endian
arrays; what is sent once an episode is JSON.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any, Protocol, runtime_checkable

import numpy as np

from stylesim.arrays import frozen
from stylesim.envs.config import EnvConfig
from stylesim.envs.world import EgoCommand, EgoState, Picture, Snapshot
from stylesim.population import Population
from stylesim.road import Lane, Road
from stylesim.scenario import Scenario

HEAD = struct.Struct("<IB")
COMMAND = struct.Struct("<ddb")
COUNTS = struct.Struct("<II")
LENGTH = struct.Struct("<I")
COLUMNS: tuple[tuple[str, str, int], ...] = (  # field of Snapshot, dtype, numbers per vehicle
    ("pose", "<f8", 7),
    ("number", "<i4", 1),
    ("knob", "<f4", 1),
    ("style", "i1", 1),
    ("decision", "i1", 1),
    ("ran_red", "?", 1),
    ("crashed", "?", 1),
)
MAX_BODY = 1 << 26  # more is no message of ours


@runtime_checkable
class Readable(Protocol):
    """What messages are read from."""

    def read(self, size: int, /) -> bytes: ...  # noqa: D102


@runtime_checkable
class Writable(Protocol):
    """What messages are written to."""

    def write(self, data: bytes, /) -> int: ...  # noqa: D102
    def flush(self) -> None: ...  # noqa: D102


class Kind(Enum):
    """What a message is."""

    RESET = ord("R")
    STEP = ord("S")
    PICTURE = ord("P")
    SNAPSHOT = ord("O")
    ERROR = ord("E")


def send(stream: Writable, kind: Kind, body: bytes = b"") -> None:
    """Write one message."""
    stream.write(HEAD.pack(len(body), kind.value) + body)
    stream.flush()


def receive(stream: Readable) -> tuple[Kind, bytes]:
    """Read one message; EOFError where the other side is gone."""
    length, kind = HEAD.unpack(_exactly(stream, HEAD.size))
    if length > MAX_BODY:
        raise EOFError(f"a message of {length} bytes: the other side does not speak this protocol")
    return Kind(kind), _exactly(stream, length)


def _exactly(stream: Readable, size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError("the other side has closed the pipe")
    return data


def packed_json(value: Mapping[str, Any]) -> bytes:
    """A mapping as the body of a message."""
    return json.dumps(value).encode()


def packed_commands(commands: Sequence[EgoCommand]) -> bytes:
    """The body of a step."""
    return b"".join(COMMAND.pack(*command) for command in commands)


def unpacked_commands(body: bytes) -> tuple[EgoCommand, ...]:
    """The commands in the body of a step."""
    return tuple(EgoCommand(*numbers) for numbers in COMMAND.iter_unpack(body))


def packed_snapshots(snapshots: Sequence[Snapshot]) -> bytes:
    """Snapshots as bytes, each behind its length."""
    bodies = [packed_snapshot(snapshot) for snapshot in snapshots]
    return b"".join(part for body in bodies for part in (LENGTH.pack(len(body)), body))


def unpacked_snapshots(body: bytes) -> tuple[Snapshot, ...]:
    """What `packed_snapshots` packed."""
    found, at = [], 0
    while at < len(body):
        (length,) = LENGTH.unpack_from(body, at)
        at += LENGTH.size
        found.append(unpacked_snapshot(body[at : at + length]))
        at += length
    return tuple(found)


def packed_snapshot(snapshot: Snapshot) -> bytes:
    """A snapshot as bytes."""
    head = COUNTS.pack(len(snapshot.number), len(snapshot.lights))
    ego = np.array(snapshot.ego, "<f8").tobytes()
    columns = [np.ascontiguousarray(getattr(snapshot, name), dtype).tobytes() for name, dtype, _ in COLUMNS]
    return b"".join([head, ego, *columns, snapshot.lights.astype("i1").tobytes()])


def unpacked_snapshot(body: bytes) -> Snapshot:
    """The snapshot in those bytes."""
    vehicles, lights = COUNTS.unpack_from(body)
    at = COUNTS.size
    ego = EgoState(*np.frombuffer(body, "<f8", len(EgoState._fields), at).tolist())
    at += 8 * len(EgoState._fields)
    columns: dict[str, np.ndarray] = {}
    for name, dtype, width in COLUMNS:
        flat = np.frombuffer(body, dtype, vehicles * width, at)
        columns[name] = (flat.reshape(vehicles, width) if width > 1 else flat).copy()
        at += flat.nbytes
    return Snapshot(ego=ego, lights=np.frombuffer(body, "i1", lights, at).copy(), **columns)


def packed_episode(scenario: Scenario, population: Population, seed: int, config: EnvConfig, egos: int) -> bytes:
    """What a new episode needs."""
    crowd = {"name": population.name, "shares": population.shares, "within_class": population.within_class}
    return packed_json({
        "scenario": scenario.model_dump(mode="json"),
        "population": crowd,
        "seed": seed,
        "config": config.model_dump(mode="json"),
        "egos": egos,
    })  # fmt: skip


def unpacked_episode(body: bytes) -> tuple[Scenario, Population, int, EnvConfig, int]:
    """What `packed_episode` packed."""
    raw = json.loads(body)
    crowd = raw["population"]
    population = Population(crowd["name"], tuple(crowd["shares"]), crowd["within_class"])
    scenario = Scenario.model_validate(raw["scenario"])
    return scenario, population, int(raw["seed"]), EnvConfig.model_validate(raw["config"]), int(raw["egos"])


def packed_picture(picture: Picture) -> bytes:
    """Road and stop lines, as far as a renderer needs them."""
    lanes = [
        {"id": lane.lane_id, "line": lane.centre_line_m.tolist(), "width": lane.width_m, "inside": lane.in_junction}
        for lane in picture.road.lanes
    ]
    return packed_json({"lanes": lanes, "stop_lines": picture.stop_lines_m.tolist()})


def unpacked_picture(body: bytes) -> Picture:
    """What `packed_picture` packed."""
    raw = json.loads(body)
    lanes = tuple(
        Lane(item["id"], np.array(item["line"], np.float32), width_m=item["width"], in_junction=item["inside"])
        for item in raw["lanes"]
    )
    stop_lines = frozen(np.array(raw["stop_lines"]).reshape(-1, 2, 2), np.float64, (None, 2, 2), "stop_lines_m")
    return Picture(Road(lanes), stop_lines)
