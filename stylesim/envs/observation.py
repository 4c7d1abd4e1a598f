"""The observation: one layout for every environment, scaled to [-1, 1], clipped, never NaN."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import gymnasium as gym
import numpy as np
from jaxtyping import Float32, Int64

from stylesim.envs.config import EnvConfig
from stylesim.envs.world import EgoState, Snapshot
from stylesim.geometry import wrap_angle
from stylesim.signals import SignalState
from stylesim.style import STYLE_CLASSES

VEHICLE_COLUMNS = ("presence", "x", "y", "vx", "vy", "cos_h", "sin_h", "length", "width")
STYLE_COLUMNS = (*(f"style_{name}" for name in STYLE_CLASSES), "aggressiveness")
SIGNAL_COLUMNS = (*(f"signal_{state.name.lower()}" for state in SignalState), "stop_line", "since_onset")
ROAD_COLUMNS = (
    "lane_offset", "lane_width", "speed_limit", "lanes_left", "lanes_right", "acceleration", "time_left",
)  # fmt: skip

# Scales: what maps to 1. Chosen, because they hold what the scenarios produce without clipping in ordinary driving.
SPEED_SCALE_MPS = 40.0
LENGTH_SCALE_M = 20.0
WIDTH_SCALE_M = 5.0
ONSET_SCALE_S = 30.0
LANES_SCALE = 4.0
ACCELERATION_SCALE_MPS2 = 10.0


@dataclass(frozen=True)
class Layout:
    """Where what stands in the flat observation, and how to get it back in physical units.

    `[vehicle 0 (ego) | vehicle 1 … N, nearest first | signal | road]`; the ego's row is in the frame of its lane,
    the others' rows are relative to the ego, x along its heading. Absent vehicles are rows of zeros.
    """

    neighbours: int
    perception_m: float
    observe_style: bool

    @property
    def vehicle_columns(self) -> tuple[str, ...]:
        """Names of one vehicle's columns."""
        return VEHICLE_COLUMNS + (STYLE_COLUMNS if self.observe_style else ())

    @cached_property
    def names(self) -> tuple[str, ...]:
        """A name for each number of the observation."""
        rows = ("ego", *(f"neighbour_{i}" for i in range(self.neighbours)))
        vehicles = tuple(f"{row}.{column}" for row in rows for column in self.vehicle_columns)
        return vehicles + SIGNAL_COLUMNS + ROAD_COLUMNS

    @property
    def space(self) -> gym.spaces.Box:
        """The observation space."""
        return gym.spaces.Box(-1.0, 1.0, (len(self.names),), np.float32)

    def vehicles(self, observation: Float32[np.ndarray, " value"]) -> Float32[np.ndarray, "vehicle column"]:
        """The table of vehicles in an observation: the ego, then its neighbours."""
        rows, columns = self.neighbours + 1, len(self.vehicle_columns)
        return observation[: rows * columns].reshape(rows, columns)

    def signal(self, observation: Float32[np.ndarray, " value"]) -> Float32[np.ndarray, " column"]:
        """The signal's columns of an observation."""
        return observation[-len(SIGNAL_COLUMNS) - len(ROAD_COLUMNS) : -len(ROAD_COLUMNS)]

    def road(self, observation: Float32[np.ndarray, " value"]) -> Float32[np.ndarray, " column"]:
        """The road's columns of an observation."""
        return observation[-len(ROAD_COLUMNS) :]

    def nearest(self, snapshot: Snapshot) -> Int64[np.ndarray, " neighbour"]:
        """Rows of the snapshot that are seen: within the perception range, nearest first, at most N."""
        gap = np.hypot(*(snapshot.pose[1:, :2] - snapshot.pose[0, :2]).T)
        order = np.argsort(gap, kind="stable")[: self.neighbours]
        return order[gap[order] <= self.perception_m].astype(np.int64) + 1

    def encode(
        self, snapshot: Snapshot, rows: Int64[np.ndarray, " neighbour"], config: EnvConfig
    ) -> Float32[np.ndarray, " value"]:
        """The observation of a snapshot, `rows` being its seen neighbours."""
        table = np.zeros((self.neighbours + 1, len(self.vehicle_columns)))
        table[0, : len(VEHICLE_COLUMNS)] = self._ego_row(snapshot)
        table[1 : len(rows) + 1, : len(VEHICLE_COLUMNS)] = self._neighbour_rows(snapshot, rows)
        if self.observe_style:
            table[1 : len(rows) + 1, len(VEHICLE_COLUMNS) :] = _style_rows(snapshot, rows)
        parts = (table.ravel(), self._signal(snapshot.ego), _road(snapshot.ego, config))
        return np.clip(np.nan_to_num(np.concatenate(parts)), -1.0, 1.0).astype(np.float32)

    def _ego_row(self, snapshot: Snapshot) -> tuple[float, ...]:
        ego, size = snapshot.ego, snapshot.pose[0, 5:]
        c, s = np.cos(ego.lane_heading_rad), np.sin(ego.lane_heading_rad)
        speed = ego.speed_mps / SPEED_SCALE_MPS
        return (1.0, 0.0, 0.0, speed * c, speed * s, c, s, size[0] / LENGTH_SCALE_M, size[1] / WIDTH_SCALE_M)

    def _neighbour_rows(self, snapshot: Snapshot, rows: Int64[np.ndarray, " neighbour"]) -> np.ndarray:
        pose, ego = snapshot.pose[rows], snapshot.pose[0]
        c, s = np.cos(ego[4]), np.sin(ego[4])
        turn = np.array([[c, -s], [s, c]])
        heading = wrap_angle(pose[:, 4] - ego[4])
        return np.column_stack([
            np.ones(len(rows)),
            (pose[:, :2] - ego[:2]) @ turn / self.perception_m,
            (pose[:, 2:4] - ego[2:4]) @ turn / SPEED_SCALE_MPS,
            np.cos(heading),
            np.sin(heading),
            pose[:, 5] / LENGTH_SCALE_M,
            pose[:, 6] / WIDTH_SCALE_M,
        ])  # fmt: skip

    def _signal(self, ego: EgoState) -> np.ndarray:
        one_hot = np.eye(len(SignalState))[int(ego.signal_state)]
        distance = min(ego.stop_line_m, self.perception_m) / self.perception_m
        return np.array([*one_hot, distance, ego.since_onset_s / ONSET_SCALE_S])


def _style_rows(snapshot: Snapshot, rows: Int64[np.ndarray, " neighbour"]) -> np.ndarray:
    one_hot = snapshot.style[rows, None] == np.arange(len(STYLE_CLASSES))
    return np.column_stack([one_hot, snapshot.knob[rows]])


def _road(ego: EgoState, config: EnvConfig) -> np.ndarray:
    return np.array([
        ego.lane_offset_m / WIDTH_SCALE_M,
        ego.lane_width_m / WIDTH_SCALE_M,
        ego.speed_limit_mps / SPEED_SCALE_MPS,
        ego.lanes_left / LANES_SCALE,
        ego.lanes_right / LANES_SCALE,
        ego.acceleration_mps2 / ACCELERATION_SCALE_MPS2,
        1.0 - ego.time_s / config.duration_s,
    ])  # fmt: skip
