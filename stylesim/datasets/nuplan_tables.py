"""The tables of a nuPlan log as a `Recording`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.datasets.accounting import row_counts
from stylesim.datasets.clocks import frames_of
from stylesim.datasets.recording import Recording, SignalLog
from stylesim.datasets.rows import usable
from stylesim.datasets.sqlite_files import opened
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind

TABLES = ("log", "lidar_pc", "ego_pose", "lidar_box", "track", "category", "traffic_light_status")
EGO = "ego"
STEP_S = 0.05  # 20 Hz [read from a log: 0.04998 to 0.05003 s]
KINDS = {
    "vehicle": AgentKind.CAR,  # "all four or more wheeled vehicles, as well as trailers" (category table)
    "bicycle": AgentKind.BICYCLE,  # "bicycles, motorcycles and tricycles"
    "pedestrian": AgentKind.PEDESTRIAN,
    "traffic_cone": AgentKind.STATIC,
    "barrier": AgentKind.STATIC,
    "czone_sign": AgentKind.STATIC,
}
# The Pacifica of the recordings, by the published devkit: 5.176 m long, 2.297 m wide, 1.127 m from the rear axle
# (where ego_pose is) to the rear end.
EGO_LENGTH_M, EGO_WIDTH_M, EGO_AXLE_TO_CENTRE_M = 5.176, 2.297, 5.176 / 2 - 1.127
STATES = {"green": SignalState.GREEN, "yellow": SignalState.YELLOW, "red": SignalState.RED}
STALE_S = 1.5 * STEP_S  # every frame states its own lights: what it does not state is unknown

_FRAMES = """
SELECT p.timestamp, e.timestamp, e.x, e.y, e.qw, e.qx, e.qy, e.qz, e.vx, e.vy, p.token
FROM lidar_pc p LEFT JOIN ego_pose e ON e.token = p.ego_pose_token ORDER BY p.timestamp, p.token
"""
_BOXES = """
SELECT hex(b.track_token), c.name, t.length, t.width, p.timestamp, b.x, b.y, b.vx, b.vy, b.yaw
FROM lidar_box b LEFT JOIN lidar_pc p ON p.token = b.lidar_pc_token
LEFT JOIN track t ON t.token = b.track_token LEFT JOIN category c ON c.token = t.category_token
"""
_LIGHTS = """
SELECT p.timestamp, s.lane_connector_id, s.status
FROM traffic_light_status s JOIN lidar_pc p ON p.token = s.lidar_pc_token
"""


@dataclass(frozen=True, eq=False)
class Log:
    """One log and where it was recorded."""

    recording: Recording
    location: str


@dataclass(frozen=True, eq=False)
class _Rows:
    agent: np.ndarray  # names
    kind: np.ndarray
    time_us: Float64[np.ndarray, " row"]
    numbers: Float64[np.ndarray, "row 7"]  # length, width, x, y, vx, vy, yaw


def log_of(file: Path) -> Log:
    """The log in that file. InputError, or what bad content raises, where it is damaged.

    Dropped: `orphan` (a box without track or frame), `unreadable`, `implausible`, `duplicate`; later `other_rate`.
    """
    with opened(file, TABLES) as database:
        location = database.execute("SELECT location FROM log").fetchone()
        frames = database.execute(_FRAMES).fetchall()
        boxes = database.execute(_BOXES).fetchall()
        lights = database.execute(_LIGHTS).fetchall()
    if not frames or not location:
        raise InputError(f"{file} holds no frame or no log")
    clock = np.unique(_numbers([row[0] for row in frames]))
    grid = frames_of(clock / 1e6 - clock[0] / 1e6, STEP_S, file)
    rows, dropped = _joined(_ego(frames), boxes)
    recording = _recording(file, rows, clock, grid, dropped, _signals(lights, clock, grid))
    row_counts(rows_in=len(frames) + len(boxes), rows_out=len(recording.frame), dropped=recording.dropped)  # checks
    return Log(recording, str(location[0] or "nuplan"))


def _numbers(values: list[Any]) -> Float64[np.ndarray, " value"]:
    return np.array([np.nan if v is None else v for v in values], np.float64)


def _ego(frames: list[tuple[Any, ...]]) -> _Rows:
    """The ego vehicle at the time of each frame: its pose was taken up to 0.03 s earlier or later."""
    table = np.array([[np.nan if v is None else v for v in row[:10]] for row in frames], np.float64)
    time, stamp, x, y, qw, qx, qy, qz, vx, vy = table.T
    yaw = np.arctan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy**2 + qz**2))
    c, s = np.cos(yaw), np.sin(yaw)
    east, north = c * vx - s * vy, s * vx + c * vy  # velocities are in the vehicle's frame [checked on a log]
    since = np.clip((time - stamp) / 1e6, -STEP_S, STEP_S)
    size = np.broadcast_to([EGO_LENGTH_M, EGO_WIDTH_M], (len(table), 2))
    place = np.stack([x + east * since + c * EGO_AXLE_TO_CENTRE_M, y + north * since + s * EGO_AXLE_TO_CENTRE_M], -1)
    numbers = np.concatenate([size, place, np.stack([east, north, yaw], -1)], axis=1)
    names = np.full(len(table), EGO, object)
    return _Rows(names, np.full(len(table), int(AgentKind.CAR)), time, numbers)


def _joined(ego: _Rows, boxes: list[tuple[Any, ...]]) -> tuple[_Rows, dict[str, int]]:
    whole = [row for row in boxes if row[0] and row[1] is not None and row[4] is not None]
    table = np.array([[np.nan if v is None else v for v in row[2:]] for row in whole], np.float64).reshape(-1, 8)
    kinds = np.array([int(KINDS.get(row[1], AgentKind.OTHER)) for row in whole], np.int64)
    joined = _Rows(
        np.concatenate([ego.agent, np.array([str(row[0]).lower() for row in whole], object)]),
        np.concatenate([ego.kind, kinds]),
        np.concatenate([ego.time_us, table[:, 2]]),
        np.concatenate([ego.numbers, table[:, [0, 1, 3, 4, 5, 6, 7]]]),
    )
    return joined, {"orphan": len(boxes) - len(whole)}


def _recording(
    file: Path,
    rows: _Rows,
    clock: Float64[np.ndarray, " time"],
    grid: Int64[np.ndarray, " time"],
    dropped: dict[str, int],
    signals: SignalLog | None,
) -> Recording:
    size, position = rows.numbers[:, 0:2], rows.numbers[:, 2:4]
    velocity, yaw = rows.numbers[:, 4:6], rows.numbers[:, 6]
    kept: Bool[np.ndarray, " row"]
    kept, lost = usable(position, velocity, yaw, size, file=file)
    frame = grid[np.searchsorted(clock, np.nan_to_num(rows.time_us)).clip(0, len(clock) - 1)]
    ids, agent = np.unique(rows.agent.astype(str), return_inverse=True)
    key = agent * (int(grid.max()) + 1) + frame
    order = np.flatnonzero(kept)[np.argsort(key[kept], kind="stable")]
    first = np.ones(len(order), bool)
    first[1:] = np.diff(key[order]) > 0
    once = order[first]
    seen, number = np.unique(agent[once], return_inverse=True)
    start = once[np.searchsorted(number, np.arange(len(seen)))]
    return Recording(
        recording_id=f"nuplan_{file.stem}",
        agent_id=tuple(str(ids[i]) for i in seen),
        kind=rows.kind[start].astype(np.int8),
        size_m=size[start].astype(np.float32),
        agent=number.astype(np.int64),
        frame=frame[once].astype(np.int64),
        position_m=position[once],
        velocity_mps=velocity[once],
        heading_rad=wrap_angle(yaw[once]),
        lookahead=np.zeros(len(once), np.int64),
        dt_s=STEP_S,
        signals=signals,
        dropped={**dropped, **lost, "duplicate": len(order) - len(once)},
    )


def _signals(
    lights: list[tuple[Any, ...]], clock: Float64[np.ndarray, " time"], grid: Int64[np.ndarray, " time"]
) -> SignalLog | None:
    if not lights:
        return None
    lanes = sorted({int(row[1]) for row in lights})
    state = np.full((len(lanes), len(clock)), int(SignalState.UNKNOWN), np.int8)
    at = np.searchsorted(clock, _numbers([row[0] for row in lights])).clip(0, len(clock) - 1)
    for event, (_, lane, status) in zip(at.tolist(), lights, strict=True):
        state[lanes.index(int(lane)), event] = int(STATES.get(str(status), SignalState.UNKNOWN))
    names = tuple(str(lane) for lane in lanes)
    return SignalLog(grid * STEP_S, names, state, STALE_S, lane_id=tuple((name,) for name in names))
