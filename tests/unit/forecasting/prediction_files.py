"""Prediction files as their owners write them: Argoverse 2 Parquet, and Waymo's protobuf by its field numbers."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import polars as pl

from stylesim.scene import Scene

T0 = 49  # the frame that the scenes of these tests fix


def truth(scene: Scene, agent: int, *, every: int = 1, steps: int = 60, t0: int = T0) -> np.ndarray:
    """The true future in the source's frame."""
    ahead = np.arange(t0 + every, t0 + 1 + steps, every)
    return scene.tracks.position_m[agent, ahead].astype(np.float64) + scene.tracks.origin_m


def av2_file(path: Path, scenes: Scene | Sequence[Scene], agents: list[int], *, t0: int | None = None) -> Path:
    """Two modes of each agent: the truth with 0.25, and 5 m beside it with 0.75."""
    rows = []
    several = [scenes] if isinstance(scenes, Scene) else scenes
    for scene, agent in product(several, agents):
        for mode, chance in enumerate((0.25, 0.75)):
            where = truth(scene, agent, t0=T0 if t0 is None else t0) + 5.0 * mode
            rows.append((scene.source_scenario_id, scene.tracks.agent_id[agent], chance, where[:, 0], where[:, 1]))
    columns = ["scenario_id", "track_id", "probability", "predicted_trajectory_x", "predicted_trajectory_y"]
    table = pl.DataFrame({name: [row[i] for row in rows] for i, name in enumerate(columns)}, strict=False)
    if t0 is not None:
        table = table.with_columns(pl.lit(t0).alias("t0_frame"))
    table.write_parquet(path)
    return path


def field(number: int, payload: bytes) -> bytes:
    return bytes([number << 3 | 2]) + varint(len(payload)) + payload


def varint(value: int) -> bytes:
    out = b""
    while value > 0x7F:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def waymo_bytes(scene: Scene, agents: list[int], *, joint: bool = False) -> bytes:
    """A MotionChallengeSubmission by the published field numbers."""

    def trajectory(agent: int) -> bytes:
        where = truth(scene, agent, every=5).astype("<f4")
        return field(2, where[:, 0].tobytes()) + field(3, where[:, 1].tobytes())

    def confidence(number: int, value: float) -> bytes:
        return bytes([number << 3 | 5]) + struct.pack("<f", value)

    ids = [int(scene.tracks.agent_id[agent].split("-")[-1]) for agent in agents]
    if joint:
        objects = b"".join(
            field(2, b"\x08" + varint(i) + field(2, trajectory(agent))) for i, agent in zip(ids, agents, strict=True)
        )
        body = field(3, field(1, objects + confidence(3, 0.5)))
    else:
        objects = b"".join(
            field(1, b"\x08" + varint(i) + field(2, field(1, trajectory(agent)) + confidence(2, 3.0)))
            for i, agent in zip(ids, agents, strict=True)
        )
        body = field(2, objects)
    scenario = field(1, scene.source_scenario_id.encode()) + body
    return field(3, b"me@example.org") + field(1, scenario)
