"""On which lane every vehicle is, how far from its centre, when it changes lanes, and whom it follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int32

from stylesim.kinematics import Leaders, Motion, corridor_leaders
from stylesim.kinematics.smoothing import derivatives
from stylesim.labelers.cuts import Cut
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.roadindex import CELL_M, EDGE_TOLERANCE_M, RoadIndex
from stylesim.tracks import Tracks

# A lane is a vehicle's own only where they agree in direction this well [ours].
LANE_HEADING_DEG = 60.0
# Of several lanes the nearest, where 0.1 rad of disagreement counts like 0.3 m. Chosen: in a junction, lanes that
# fan out from one place differ in direction before they differ in position.
METRES_PER_RAD = 3.0
# A vehicle stays on its lane while no other is better by more. Chosen: above the wander within overlapping lanes.
KEEP_WITHIN_M = 0.2
# Lanes that a vehicle can be on at once, where they overlap in a junction (left, straight, right).
PLACES = 3
# From frame to frame nobody moves so far sideways: the centre that the offset is measured from changed. Chosen: a
# third of a lane, which would be 10 m/s sideways at 10 Hz.
LANE_CHANGE_JUMP_M = 1.0
# A path may miss its lane for this long (a hole in the map) before the next lane counts as a new beginning. Chosen.
BRIDGE_S = 1.0


@dataclass(frozen=True, eq=False)
class LaneMatch:
    """Per agent and frame: its lanes, best first (-1: none), the way along them, the offset (left is positive)."""

    lane: Int32[np.ndarray, "agent time place"]
    along_m: Float64[np.ndarray, "agent time place"]
    offset_m: Float64[np.ndarray, "agent time place"]


def match(
    tracks: Tracks,
    index: RoadIndex,
    wanted: Bool[np.ndarray, "agent time"],
    block: Int32[np.ndarray, " time"] | None = None,
) -> LaneMatch:
    """The lanes of every wanted vehicle and frame; where its own track made the centre line, the line without it."""
    from stylesim.labelers.lane_kernels import match_lanes

    shape = (*wanted.shape, PLACES)
    block = np.zeros(shape[1], np.int32) if block is None else block
    result = LaneMatch(np.full(shape, -1, np.int32), np.full(shape, np.nan), np.full(shape, np.nan))
    match_lanes(
        tracks.position_m, tracks.heading_rad, wanted, block, index.segment_m, index.segment_turn,
        index.segment_lane, index.reach_m, index.cell_start, index.cell_segment, index.grid_origin, index.grid_shape,
        CELL_M, float(np.cos(np.radians(LANE_HEADING_DEG))), METRES_PER_RAD, KEEP_WITHIN_M,
        result.lane, result.along_m, result.offset_m,
    )  # fmt: skip
    _leave_own_track_out(tracks, index, result)
    return result


def _leave_own_track_out(tracks: Tracks, index: RoadIndex, found: LaneMatch) -> None:
    """Measure the offset of a driver whose own track made an inferred centre from the centre without it."""
    lines = index.left_out
    if lines is None or lines.of_track.keys().isdisjoint(tracks.agent_id):
        return
    from stylesim.labelers.offset_kernels import offsets_from_lines

    offsets_from_lines(
        tracks.position_m, found.lane, *lines.of_agents(tracks.agent_id), lines.lane, lines.start, lines.point_m,
        found.offset_m,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Straying:
    """Per agent and frame: |d| (mu + |dd/dt|), 0 around lane changes, NaN where no lane is known."""

    rate: Float64[np.ndarray, "agent time"]
    changes: Bool[np.ndarray, "agent time"]  # first frame on the new lane


def straying(found: LaneMatch, cut: Cut, dt_s: float, options: FeatureOptions) -> Straying:
    """What s_center integrates. The offset is smoothed between lane changes, never across one."""
    from stylesim.labelers.lane_kernels import lane_pieces, near_event

    lane, raw = np.ascontiguousarray(found.lane[..., 0]), np.ascontiguousarray(found.offset_m[..., 0])
    piece, changes, near = np.full(lane.shape, -1, np.int32), np.zeros(lane.shape, bool), np.zeros(lane.shape, bool)
    lane_pieces(lane, raw, cut.run, max(1, round(BRIDGE_S / dt_s)), LANE_CHANGE_JUMP_M, piece, changes)
    near_event(changes, cut.block, round(options.lane_change_s / dt_s), near)
    curve = derivatives(raw[..., None], piece, dt_s, options.smoother)[:, :, 0]
    rate = np.abs(curve[..., 0]) * (options.mu_per_s + np.abs(curve[..., 1]))
    rate[near & (piece >= 0) & np.isfinite(rate)] = 0.0
    return Straying(rate=rate, changes=changes)


def leaders(
    tracks: Tracks,
    motion: Motion,
    found: LaneMatch | None,
    index: RoadIndex | None,
    *,
    is_vehicle: Bool[np.ndarray, "agent time"],
    options: FeatureOptions,
) -> Leaders:
    """Whom each vehicle follows: along its lane and the lanes after it, else straight ahead.

    Where the way forks, the nearest vehicle on any branch counts, because which branch the ego will take is the
    future. Parked vehicles on the path count: they are in the way.
    """
    position = np.where(motion.known[..., None], motion.position_m, tracks.position_m)
    on_lane = np.zeros(is_vehicle.shape, bool) if found is None else (found.lane[..., 0] >= 0) & is_vehicle
    lost = is_vehicle & ~on_lane & motion.known
    result = corridor_leaders(
        position, motion.direction, tracks.size_m,
        is_ego=lost, is_other=is_vehicle & motion.known if lost.any() else lost,
        range_m=options.leader_range_m, heading_within_rad=float(np.radians(options.neighbour_heading_deg)),
    )  # fmt: skip
    if found is not None and index is not None:
        _follow_lanes(tracks.size_m, found, index, on_lane, options.leader_range_m, result)
    return result


def _follow_lanes(
    size_m: Float[np.ndarray, "agent 2"],
    found: LaneMatch,
    index: RoadIndex,
    on_lane: Bool[np.ndarray, "agent time"],
    range_m: float,
    into: Leaders,
) -> None:
    from stylesim.labelers.lane_kernels import lane_leaders

    lane_leaders(
        found.lane, found.along_m, found.offset_m, index.reach_m, EDGE_TOLERANCE_M, index.length_m,
        index.ahead_start, index.ahead_lane, index.ahead_m, size_m.astype(np.float64), on_lane, on_lane, range_m,
        into.leader, into.gap_m,
    )  # fmt: skip
