"""Highway or not: which scaler judges a window."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.kinematics import Motion
from stylesim.labelers.cuts import Cut
from stylesim.labelers.lanes import LaneMatch
from stylesim.labelers.reduce import moments
from stylesim.labelers.roadindex import RoadIndex

CONTEXTS = ("non_highway", "highway")
# REFERENCE section 1 [ours].
HIGHWAY_LIMIT_MPS = 80 / 3.6
HIGHWAY_TRAFFIC_MPS = 18.0
# Limits are stored as float32 and some maps round to 0.1 m/s.
LIMIT_TOLERANCE_MPS = 0.05


def highway_share(
    motion: Motion,
    found: LaneMatch | None,
    index: RoadIndex | None,
    *,
    is_vehicle: Bool[np.ndarray, "agent time"],
    cut: Cut,
) -> Float64[np.ndarray, "agent window"]:
    """Share of a window's frames that are on a highway; NaN where the window has no frame with a motion.

    Limit >= 80 km/h and no junction within 150 m; where the limit is unknown, the window's median traffic speed
    >= 18 m/s: the median over its frames of the median speed of the motor vehicles that drive then.
    """
    rule = np.full(cut.window.shape, np.nan)
    if found is not None and index is not None:
        rule = _by_limit(found, index)
    rule[~motion.known] = np.nan
    unknown = motion.known & np.isnan(rule) & (cut.window >= 0)
    if unknown.any():
        fast = _traffic(motion, is_vehicle, cut) >= HIGHWAY_TRAFFIC_MPS
        agent, frame = np.nonzero(unknown)
        rule[agent, frame] = fast[agent, cut.window[agent, frame]]
    return moments(rule, cut).mean


def _by_limit(found: LaneMatch, index: RoadIndex) -> Float64[np.ndarray, "agent time"]:
    """1 on a highway lane far from junctions, 0 on another lane, NaN without a lane or limit."""
    lane = found.lane[..., 0]
    limit = np.concatenate([index.limit_mps, [np.nan]])[lane]
    on = np.nonzero(lane >= 0)
    near = np.zeros(lane.shape, bool)
    start = index.station_start[lane[on]]
    last = index.station_start[lane[on] + 1] - 1
    share = found.along_m[(*on, 0)] / np.maximum(index.length_m[lane[on]], 1e-9)
    near[on] = index.station_near_junction[start + np.rint(np.clip(share, 0, 1) * (last - start)).astype(np.int64)]
    return np.where(np.isnan(limit), np.nan, (limit >= HIGHWAY_LIMIT_MPS - LIMIT_TOLERANCE_MPS) & ~near)


def _traffic(
    motion: Motion, is_vehicle: Bool[np.ndarray, "agent time"], cut: Cut
) -> Float64[np.ndarray, "agent window"]:
    """The window's median traffic speed, m/s; NaN where it has no frame or no traffic."""
    from stylesim.labelers.window_kernels import window_traffic

    result = np.full((len(cut.window), cut.n_windows), np.nan)
    window_traffic(motion.speed_mps, is_vehicle, cut.window, result)
    return result
