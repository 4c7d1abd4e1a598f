"""Scenes as Parquet tables and back: one file of rows, of agents and of lights per part."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.corpus.codec import COLUMNS, HEADING_RAD, POSITION_M, VELOCITY_MPS, decode, encode
from stylesim.errors import CorpusError
from stylesim.scene import Scene
from stylesim.signals import Signals
from stylesim.style import PHYSICAL_FIELDS, DriverStyle
from stylesim.tracks import Tracks

DRIVER_PARAMETERS = ("aggressiveness", *PHYSICAL_FIELDS)  # order of the list in `driver_parameters`
SCALES = {"position_m": str(POSITION_M), "velocity_mps": str(VELOCITY_MPS), "heading_rad": str(HEADING_RAD)}
ROW_GROUP = 1 << 18  # fixed: the bytes must not depend on the machine
LEVEL = 9  # of zstd; chosen: 3 % smaller than 3, and encoding is still a small part of a simulation's time


def parquet_bytes(frame: pl.DataFrame, about: dict[str, str] | None = None, *, row_group: int = ROW_GROUP) -> bytes:
    """The table as Parquet, always with the same bytes for the same table and polars version.

    `about` goes into the schema metadata of the file.
    """
    buffer = io.BytesIO()
    frame.write_parquet(
        buffer, compression="zstd", compression_level=LEVEL, row_group_size=row_group, statistics=False, metadata=about
    )
    return buffer.getvalue()


def read_parquet(path: Path) -> pl.DataFrame:
    """The table in that file. CorpusError if it is missing or damaged."""
    try:
        return pl.read_parquet(path.read_bytes(), use_statistics=False)
    except FileNotFoundError:
        raise CorpusError(f"{path} is missing; the corpus is incomplete") from None
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise CorpusError(f"{path} is damaged or no Parquet file: {error}") from error


def tracks_table(scenes: Sequence[Scene]) -> pl.DataFrame:
    """One row per valid agent-frame (see `codec`), with the scene's number within the part."""
    encoded = [encode(scene.tracks) for scene in scenes]
    number = np.repeat(np.arange(len(scenes), dtype=np.int32), [len(c["agent"]) for c in encoded])
    columns = {"scene": number}
    for name in COLUMNS:
        columns[name] = np.concatenate([c[name] for c in encoded]).astype(np.int32)
    return pl.DataFrame(columns)


def agents_table(scenes: Sequence[Scene]) -> pl.DataFrame:
    """One row per (scene, agent): id, kind, size, flags, and the commanded driver where there is one."""
    rows: dict[str, list[Any]] = {
        name: [] for name in ("scene", "agent_id", "kind", "length_m", "width_m", "flags", "driver")
    }
    parameters: list[list[float] | None] = []
    for number, scene in enumerate(scenes):
        tracks = scene.tracks
        assert tracks.flags is not None
        rows["scene"] += [number] * tracks.n_agents
        rows["agent_id"] += tracks.agent_id
        rows["kind"] += tracks.kind.tolist()
        rows["length_m"] += tracks.size_m[:, 0].tolist()
        rows["width_m"] += tracks.size_m[:, 1].tolist()
        rows["flags"] += tracks.flags.tolist()
        rows["driver"] += [None if driver is None else driver.name for driver in tracks.driver]
        parameters += [_parameters(driver) for driver in tracks.driver]
    schema: dict[str, Any] = {"scene": pl.Int32, "agent_id": pl.String, "kind": pl.Int8, "length_m": pl.Float32}
    schema |= {"width_m": pl.Float32, "flags": pl.Int32, "driver": pl.String}
    return pl.DataFrame(
        {**rows, "driver_parameters": parameters}, schema={**schema, "driver_parameters": pl.List(pl.Float64)}
    )


def _parameters(driver: DriverStyle | None) -> list[float] | None:
    return None if driver is None else [getattr(driver, name) for name in DRIVER_PARAMETERS]


def signals_table(scenes: Sequence[Scene]) -> pl.DataFrame:
    """One row per change of a light: the frame from which the state holds."""
    parts: dict[str, list[np.ndarray]] = {"scene": [], "signal": [], "frame": [], "state": []}
    for number, scene in enumerate(scenes):
        if scene.signals is None:
            continue
        state = scene.signals.state
        change = np.ones(state.shape, bool)
        change[:, 1:] = state[:, 1:] != state[:, :-1]
        signal, frame = np.nonzero(change)
        parts["scene"].append(np.full(len(signal), number))
        parts["signal"].append(signal)
        parts["frame"].append(frame)
        parts["state"].append(state[signal, frame])
    joined = {k: np.concatenate(v).astype(np.int32) if v else np.zeros(0, np.int32) for k, v in parts.items()}
    return pl.DataFrame(joined)


def _signals(meta: Mapping[str, Any] | None, rows: pl.DataFrame, n_frames: int) -> Signals | None:
    if meta is None:
        return None
    change = np.full((len(meta["signal_id"]), n_frames), -1, np.int64)
    change[rows["signal"].to_numpy(), rows["frame"].to_numpy()] = rows["state"].to_numpy()
    last = np.maximum.accumulate(np.where(change >= 0, np.arange(n_frames), 0), axis=1)
    state = np.take_along_axis(change, last, axis=1).astype(np.int8)
    return Signals(tuple(meta["signal_id"]), tuple(tuple(ids) for ids in meta["lane_id"]), state)


def _driver(row: Mapping[str, Any]) -> DriverStyle | None:
    if row["driver"] is None:
        return None
    # Corpora written before a parameter existed have a shorter list; the rest takes the parameter's default.
    return DriverStyle(row["driver"], **dict(zip(DRIVER_PARAMETERS, row["driver_parameters"], strict=False)))


def part_tables(folder: Path, part: int) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Rows, agents and lights of one part."""
    return (
        read_parquet(folder / "tracks" / f"part-{part:05d}.parquet"),
        read_parquet(folder / "agents" / f"part-{part:05d}.parquet"),
        read_parquet(folder / "signals" / f"part-{part:05d}.parquet"),
    )


def tracks_and_signals(
    meta: Mapping[str, Any], number: int, tables: tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]
) -> tuple[Tracks, Signals | None]:
    """Tracks and lights of scene `number` of a part; `meta` is its row of the scene table. CorpusError if damaged."""
    try:
        rows, agents, lights = (table.filter(pl.col("scene") == number) for table in tables)
        n, frames = agents.height, int(meta["n_frames"])
        size = np.stack([agents["length_m"].to_numpy(), agents["width_m"].to_numpy()], axis=1)
        empty = Tracks(
            agent_id=tuple(agents["agent_id"].to_list()),
            kind=agents["kind"].to_numpy(),
            size_m=size.reshape(n, 2),
            position_m=np.full((n, frames, 2), np.nan, np.float32),
            velocity_mps=np.full((n, frames, 2), np.nan, np.float32),
            heading_rad=np.full((n, frames), np.nan, np.float32),
            valid=np.zeros((n, frames), bool),
            dt_s=float(meta["dt_s"]),
            origin_m=np.array([meta["origin_x_m"], meta["origin_y_m"]]),
            driver=tuple(_driver(row) for row in agents.iter_rows(named=True)),
            flags=agents["flags"].to_numpy(),
        )
        tracks = decode({name: rows[name].to_numpy() for name in COLUMNS}, empty)
        signal_meta = json.loads(meta["signals"]) if meta["signals"] else None
        return tracks, _signals(signal_meta, lights, frames)
    except (pl.exceptions.PolarsError, ValueError, KeyError, IndexError, TypeError) as error:
        raise CorpusError(f"scene {meta['scene_id']!r} is damaged: {error}") from error
