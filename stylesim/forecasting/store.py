"""Samples as flat arrays, scene-centric: agents once per (scene, t0), roads once per content, samples as indices.

The same arrays live in memory (prediction) or in memory-mapped .npy files (training). About 1.2 kB per agent and t0
instead of 28 kB per sample. No torch.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from jaxtyping import Float32, Int32, Int64

from stylesim.forecasting.config import InputConfig
from stylesim.forecasting.snapshot import LANE_ATTRIBUTES, AgentArrays, RoadArrays

NO_ROAD = -1


@dataclass(frozen=True, eq=False)
class SampleStore:
    """Everything that samples are gathered from. Ranges are (start, stop) into the arrays they name.

    There are as many targets as samples, or none where nothing is learned.
    """

    agent_state: Float32[np.ndarray, "agent time 6"]
    agent_pose: Float32[np.ndarray, "agent 3"]
    agent_attribute: Float32[np.ndarray, "agent 3"]
    piece_points: Float32[np.ndarray, "piece point 2"]
    piece_middle: Float32[np.ndarray, "piece 2"]
    piece_attribute: Float32[np.ndarray, "piece 8"]
    piece_lane: Int32[np.ndarray, " piece"]
    lane_signal: Float32[np.ndarray, "lane 2"]  # state, age; one run of a road's lanes per snapshot
    road_pieces: Int64[np.ndarray, "road 2"]
    snapshot_agents: Int64[np.ndarray, "snapshot 2"]
    snapshot_lanes: Int64[np.ndarray, " snapshot"]  # start of its run in lane_signal, -1: no signals
    sample: Int64[np.ndarray, "sample 3"]  # snapshot, agent (row of agent_state), road or NO_ROAD
    origin: Int64[np.ndarray, "target 4"]  # scene number (train and val), t0, agent index, split (0, 1)
    weight: Float32[np.ndarray, " target"]
    future_m: Float32[np.ndarray, "target future 2"]  # scene frame

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.sample)

    @classmethod
    def load(cls, folder: Path) -> SampleStore:
        """The memory-mapped store in a folder."""
        return cls(**{name: _mapped(folder / f"{name}.npy") for name in cls.__dataclass_fields__})


def _mapped(path: Path) -> npt.NDArray[Any]:
    # numpy cannot map a file without elements
    empty = np.load(path, mmap_mode=None) if path.stat().st_size <= 256 else None
    return np.load(path, mmap_mode="r") if empty is None or empty.size else empty


def _layout(config: InputConfig) -> dict[str, tuple[type, tuple[int, ...]]]:
    """Element type and trailing shape of every array of the store."""
    return {
        "agent_state": (np.float32, (config.history_steps, 6)),
        "agent_pose": (np.float32, (3,)),
        "agent_attribute": (np.float32, (3,)),
        "piece_points": (np.float32, (config.points, 2)),
        "piece_middle": (np.float32, (2,)),
        "piece_attribute": (np.float32, (LANE_ATTRIBUTES,)),
        "piece_lane": (np.int32, ()),
        "lane_signal": (np.float32, (2,)),
        "road_pieces": (np.int64, (2,)),
        "snapshot_agents": (np.int64, (2,)),
        "snapshot_lanes": (np.int64, ()),
        "sample": (np.int64, (3,)),
        "origin": (np.int64, (4,)),
        "weight": (np.float32, ()),
        "future_m": (np.float32, (config.future_steps, 2)),
    }


@runtime_checkable
class Sink(Protocol):
    """Takes rows of named arrays, in order."""

    def append(self, name: str, rows: npt.NDArray[Any]) -> None:
        """Add rows to the end of an array."""
        ...


class MemorySink:
    """Rows kept in memory."""

    def __init__(self, config: InputConfig) -> None:
        self._layout = _layout(config)
        self._rows: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in self._layout}

    def append(self, name: str, rows: npt.NDArray[Any]) -> None:
        """Add rows to the end of an array."""
        self._rows[name].append(rows)

    def store(self) -> SampleStore:
        """The store of all rows so far."""
        arrays: dict[str, npt.NDArray[Any]] = {}
        for name, (dtype, shape) in self._layout.items():
            arrays[name] = np.concatenate([np.zeros((0, *shape), dtype), *self._rows[name]])
        return SampleStore(**arrays)


class FileSink:
    """Rows written to growing .npy files; the lengths are set when it closes. A context manager."""

    def __init__(self, folder: Path, config: InputConfig) -> None:
        self._layout = _layout(config)
        self._length = dict.fromkeys(self._layout, 0)
        self._files: dict[str, BinaryIO] = {name: (folder / f"{name}.npy").open("wb") for name in self._layout}
        for name in self._files:
            self._write_header(name)

    def append(self, name: str, rows: npt.NDArray[Any]) -> None:
        """Add rows to the end of an array."""
        self._files[name].write(np.ascontiguousarray(rows, self._layout[name][0]).tobytes())
        self._length[name] += len(rows)

    def _write_header(self, name: str) -> None:
        # numpy leaves room in the header for the first axis to grow, so a second header has the same length
        dtype, shape = self._layout[name]
        header = {
            "descr": np.lib.format.dtype_to_descr(np.dtype(dtype)),
            "fortran_order": False,
            "shape": (self._length[name], *shape),
        }
        np.lib.format.write_array_header_1_0(self._files[name], header)

    def __enter__(self) -> FileSink:
        """The sink itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the lengths and close the files."""
        for name, file in self._files.items():
            with file:
                file.seek(0)
                self._write_header(name)


class StoreBuilder:
    """Turns snapshots, roads and samples into rows of a sink, and keeps count."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._agents = self._pieces = self._roads = self._snapshots = self._lanes = 0
        self._known_roads: dict[bytes, int] = {}
        self._last_road: tuple[RoadArrays, int] | None = None  # most drivers of a scene see the same one
        self.n_samples = 0

    def road(self, arrays: RoadArrays) -> int:
        """The number of a road; one of equal content is stored once."""
        if self._last_road is not None and self._last_road[0] is arrays:
            return self._last_road[1]
        key = sha256(arrays.points_m.tobytes() + arrays.attribute.tobytes() + arrays.lane.tobytes()).digest()
        if key not in self._known_roads:
            first = self._pieces
            self._pieces += len(arrays.lane)
            for name in ("points_m", "middle_m", "attribute", "lane"):
                self._sink.append(f"piece_{name.removesuffix('_m')}", getattr(arrays, name))
            self._sink.append("road_pieces", np.array([[first, self._pieces]], np.int64))
            self._known_roads[key] = self._roads
            self._roads += 1
        self._last_road = arrays, self._known_roads[key]
        return self._known_roads[key]

    def snapshot(self, agents: AgentArrays, signals: Float32[np.ndarray, "lane 2"] | None) -> tuple[int, int]:
        """Store what is seen at one t0; its number, and the row of its first agent."""
        first = self._agents
        self._agents += len(agents.pose)
        for name in ("state", "pose", "attribute"):
            self._sink.append(f"agent_{name}", getattr(agents, name))
        self._sink.append("snapshot_agents", np.array([[first, self._agents]], np.int64))
        self._sink.append("snapshot_lanes", np.array([-1 if signals is None else self._lanes], np.int64))
        if signals is not None:
            self._sink.append("lane_signal", signals)
            self._lanes += len(signals)
        self._snapshots += 1
        return self._snapshots - 1, first

    def samples(
        self,
        sample: Int64[np.ndarray, "sample 3"],
        *,
        origin: Int64[np.ndarray, "sample 4"],
        weight: Float32[np.ndarray, " sample"],
        future_m: Float32[np.ndarray, "sample future 2"],
    ) -> None:
        """Store samples of snapshots and roads stored before."""
        for name, rows in (("sample", sample), ("origin", origin), ("weight", weight), ("future_m", future_m)):
            self._sink.append(name, rows)
        self.n_samples += len(sample)
