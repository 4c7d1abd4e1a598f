"""The two tables of an Argoverse 2 sensor log as boxes by agent and frame, in the city's frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.datasets.clocks import frames_of
from stylesim.datasets.grids import Grid, grid_of
from stylesim.datasets.guarding import bounded
from stylesim.datasets.rotations import heading_of, rotation_of
from stylesim.errors import InputError
from stylesim.tracks import AgentKind

EGO = "AV"
DT_S = 0.1
MAX_FRAMES = 100_000
# A Ford Fusion of 2017: 4.869 m long, 1.852 m wide, wheelbase 2.850 m by its maker. The pose is at the middle of the
# rear axle [read: av2 documentation]; the rear overhang of 1.05 m is chosen, a third of what the wheelbase leaves
# being in front is common.
EGO_SIZE_M, EGO_AXLE_TO_CENTRE_M = (4.869, 1.852), 4.869 / 2 - 1.05
_VEHICLES = {
    "REGULAR_VEHICLE": AgentKind.CAR,
    "RAILED_VEHICLE": AgentKind.OTHER,
    "LARGE_VEHICLE": AgentKind.TRUCK,
    "BOX_TRUCK": AgentKind.TRUCK,
    "TRUCK": AgentKind.TRUCK,
    "TRUCK_CAB": AgentKind.TRUCK,
    "BUS": AgentKind.BUS,
    "SCHOOL_BUS": AgentKind.BUS,
    "ARTICULATED_BUS": AgentKind.BUS,
}
# A rider's box counts; the box of the machine under him, drawn separately, is OTHER: it would be a second vehicle.
_RIDERS = {
    "MOTORCYCLIST": AgentKind.MOTORCYCLE,
    "BICYCLIST": AgentKind.BICYCLE,
    "WHEELED_RIDER": AgentKind.BICYCLE,
}
_WALKERS = ("PEDESTRIAN", "STROLLER", "WHEELCHAIR", "OFFICIAL_SIGNALER")
_STANDING = (
    "BOLLARD", "CONSTRUCTION_CONE", "CONSTRUCTION_BARREL", "STOP_SIGN", "SIGN", "MOBILE_PEDESTRIAN_CROSSING_SIGN",
    "MESSAGE_BOARD_TRAILER", "TRAFFIC_LIGHT_TRAILER",
)  # fmt: skip
KINDS = {
    **_VEHICLES,
    **_RIDERS,
    **dict.fromkeys(_WALKERS, AgentKind.PEDESTRIAN),
    **dict.fromkeys(_STANDING, AgentKind.STATIC),
}
_QUATERNION = ("qw", "qx", "qy", "qz")
_PLACE = ("tx_m", "ty_m", "tz_m")
_POSE: dict[str, Any] = {"timestamp_ns": pl.Int64, **dict.fromkeys((*_QUATERNION, *_PLACE), pl.Float64)}
_BOX: dict[str, Any] = {
    **_POSE,
    "track_uuid": pl.String,
    "category": pl.String,
    "length_m": pl.Float64,
    "width_m": pl.Float64,
}


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes by agent and frame, the category of each row that was kept, and rows dropped by reason."""

    grid: Grid
    category: list[str]
    dropped: dict[str, int]
    rows: int  # of the source: boxes, and one pose of the ego vehicle per sweep


def boxes_of(annotations: Path, poses: Path) -> Boxes:
    """The boxes of a log. InputError where a table is missing, damaged, or lacks a column.

    Dropped: `unreadable` (no time, track or category), `no_pose` (no pose of the vehicle at that time).
    """
    pose = _table(poses, _POSE).drop_nulls("timestamp_ns").unique("timestamp_ns", keep="first").sort("timestamp_ns")
    if pose.is_empty():
        raise InputError(f"{poses} has no usable row")
    raw = _table(annotations, _BOX) if annotations.exists() else pl.DataFrame(schema=_BOX)
    table = raw.drop_nulls(["timestamp_ns", "track_uuid", "category"])
    placed = table.join(pose, on="timestamp_ns", how="inner", suffix="_ego", maintain_order="left")
    dropped = {"unreadable": raw.height - table.height, "no_pose": table.height - placed.height}
    if raw.height and placed.is_empty():
        raise InputError(f"{annotations} has no box at a time of which there is a pose: {dropped}")
    sweeps = placed["timestamp_ns"].unique().sort() if placed.height else _every_tenth(pose["timestamp_ns"])
    stamps = sweeps.to_numpy()
    clock = frames_of((stamps - stamps[0]) / 1e9, DT_S, annotations)
    n_frames = int(clock[-1]) + 1
    if not 2 <= n_frames <= MAX_FRAMES:
        raise InputError(f"{annotations} has {n_frames} frames")
    ego = rotation_of(placed.select(f"{name}_ego" for name in _QUATERNION).to_numpy())
    own = rotation_of(placed.select(_QUATERNION).to_numpy())
    offset = placed.select(_PLACE).to_numpy()
    place = np.einsum("rij,rj->ri", ego, offset) + placed.select(f"{name}_ego" for name in _PLACE).to_numpy()
    at = pose.filter(pl.col("timestamp_ns").is_in(sweeps.implode()))
    heading = heading_of(rotation_of(at.select(_QUATERNION).to_numpy()))
    ahead = np.stack([np.cos(heading), np.sin(heading)], -1) * EGO_AXLE_TO_CENTRE_M
    ego_place, ego_heading = np.full((n_frames, 2), np.nan), np.full(n_frames, np.nan)
    ego_valid = np.zeros(n_frames, bool)
    ego_place[clock], ego_heading[clock] = at.select(_PLACE[:2]).to_numpy() + ahead, heading
    ego_valid[clock] = True
    grid = grid_of(
        agent=placed["track_uuid"].to_list(),
        frame=clock[np.searchsorted(stamps, placed["timestamp_ns"].to_numpy())],
        position_m=place[:, :2],
        heading_rad=heading_of(ego @ own),
        size_m=placed.select("length_m", "width_m").to_numpy(),
        ego_id=EGO,
        ego_position_m=ego_place,
        ego_heading_rad=ego_heading,
        ego_size_m=EGO_SIZE_M,
        ego_valid=ego_valid,
    )
    return Boxes(grid, placed["category"].to_list(), dropped, raw.height + len(clock))


def _every_tenth(stamps: pl.Series) -> pl.Series:
    """Of the poses of a log without boxes, those nearest to every 0.1 s."""
    times = stamps.to_numpy()
    wanted = np.arange(times[0], times[-1] + 1, round(DT_S * 1e9))
    if len(wanted) > MAX_FRAMES:
        raise InputError(f"the poses reach over {len(wanted) * DT_S:g} s; the timestamps are damaged")
    index = np.searchsorted(times, wanted).clip(0, len(times) - 1)
    return pl.Series(np.unique(times[index]))


def _table(file: Path, columns: dict[str, Any]) -> pl.DataFrame:
    """These columns of a feather file (Arrow IPC), in those types."""
    bounded(file, 1 << 30)
    table = pl.read_ipc(file.read_bytes())
    absent = [name for name in columns if name not in table.columns]
    if absent:
        raise InputError(f"{file} lacks the columns {', '.join(absent)}; it is no table of Argoverse 2")
    return table.select(pl.col(name).cast(dtype) for name, dtype in columns.items())
