"""What a forecaster may see of one scene at t0, as plain arrays: the only way from a `Scene` into the network.

Training and prediction both come through here, and both hand in `Scene.history(...)`: nothing later than t0, no
commanded style and no outcome flag exists in what these functions read. No torch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int32, Int64

from stylesim.forecasting.config import InputConfig
from stylesim.geometry import arc_length
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.signals import Signals, SignalState

STATE_X, STATE_Y, STATE_VX, STATE_VY, STATE_HEADING, STATE_VALID = range(6)
LANE_ATTRIBUTES = 8  # width, limit, limit known, in junction, inferred, stop line known, its middle x, y


@dataclass(frozen=True, eq=False)
class RoadArrays:
    """A road as pieces of lanes, each resampled to the same number of points. Scene frame, unknown is 0."""

    points_m: Float32[np.ndarray, "piece point 2"]
    middle_m: Float32[np.ndarray, "piece 2"]
    attribute: Float32[np.ndarray, "piece attribute"]
    lane: Int32[np.ndarray, " piece"]  # index into road.lanes
    n_lanes: int


@dataclass(frozen=True, eq=False)
class AgentArrays:
    """The agents that are known at t0; `row` is -1 for those of the scene that are not."""

    state: Float32[np.ndarray, "agent time state"]  # STATE_*; all 0 where invalid, padded on the left
    pose: Float32[np.ndarray, "agent 3"]  # x, y, heading at t0
    attribute: Float32[np.ndarray, "agent 3"]  # length, width, kind
    row: Int64[np.ndarray, " all"]


def agent_arrays(history: Scene, config: InputConfig) -> AgentArrays:
    """The last `history_steps` frames of every agent that is known in the last one."""
    tracks = history.tracks
    present = np.flatnonzero(tracks.valid[:, -1])
    steps = min(config.history_steps, tracks.n_frames)
    valid = tracks.valid[present, -steps:]
    state = np.zeros((len(present), config.history_steps, 6), np.float32)
    seen = state[:, -steps:]
    seen[..., STATE_X : STATE_Y + 1] = tracks.position_m[present, -steps:]
    seen[..., STATE_VX : STATE_VY + 1] = tracks.velocity_mps[present, -steps:]
    seen[..., STATE_HEADING] = tracks.heading_rad[present, -steps:]
    seen[..., STATE_VALID] = 1.0
    seen[~valid] = 0.0
    row = np.full(tracks.n_agents, -1, np.int64)
    row[present] = np.arange(len(present))
    size = np.nan_to_num(tracks.size_m[present])
    return AgentArrays(
        state=state,
        pose=state[:, -1, [STATE_X, STATE_Y, STATE_HEADING]],
        attribute=np.column_stack([size, tracks.kind[present]]).astype(np.float32),
        row=row,
    )


def _pieces(lane: Lane, count: int, points: int) -> Float32[np.ndarray, "piece point 2"]:
    """The centre line in `count` pieces of equal length; the end of one is the start of the next."""
    along = arc_length(lane.centre_line_m)
    cuts = np.linspace(0.0, along[-1], count + 1)
    at = cuts[:-1, None] + np.diff(cuts)[:, None] * np.linspace(0.0, 1.0, points)
    line = lane.centre_line_m
    return np.stack([np.interp(at, along, line[:, 0]), np.interp(at, along, line[:, 1])], axis=-1).astype(np.float32)


def _attributes(lane: Lane, *, inferred: bool) -> Float32[np.ndarray, " attribute"]:
    stop = None if lane.stop_line_m is None else lane.stop_line_m.mean(axis=0)
    return np.array(
        [
            np.nan_to_num(lane.width_m),
            np.nan_to_num(lane.speed_limit_mps),
            np.isfinite(lane.speed_limit_mps),
            lane.in_junction,
            inferred,
            stop is not None,
            *((0.0, 0.0) if stop is None else stop),
        ],
        np.float32,
    )


def road_arrays(road: Road, config: InputConfig, *, without: str = "") -> RoadArrays:
    """The lanes of `road`, cut into pieces; lanes inferred from tracks are made without that track.

    A target must be left out of its own centre line: the line was inferred from whole tracks, futures included.
    """
    points, attributes, lane_index = [], [], []
    for number, lane in enumerate(road.lanes):
        count = max(1, int(np.ceil(arc_length(lane.centre_line_m)[-1] / config.piece_m)))
        points.append(_pieces(lane.without(without) if without else lane, count, config.points))
        attributes.append(np.tile(_attributes(lane, inferred=road.source == "inferred"), (count, 1)))
        lane_index.append(np.full(count, number, np.int32))
    if not points:
        return RoadArrays(
            np.zeros((0, config.points, 2), np.float32),
            np.zeros((0, 2), np.float32),
            np.zeros((0, LANE_ATTRIBUTES), np.float32),
            np.zeros(0, np.int32),
            0,
        )
    all_points = np.concatenate(points)
    return RoadArrays(
        all_points,
        all_points[:, (config.points - 1) // 2 : config.points // 2 + 1].mean(axis=1, dtype=np.float32),
        np.concatenate(attributes),
        np.concatenate(lane_index),
        len(road.lanes),
    )


def evidence(road: Road) -> frozenset[str]:
    """The tracks from which lanes of this road were inferred."""
    return frozenset(track for lane in road.lanes if lane.evidence is not None for track in lane.evidence.track_id)


def lane_signals(road: Road, signals: Signals, config: InputConfig) -> Float32[np.ndarray, "lane 2"]:
    """For every lane, what its light shows at t0 (SignalState) and for how long it has within the history, s.

    Where several lights control one lane, the most restrictive counts. Lights without a known lane are left out.
    """
    number = {lane.lane_id: i for i, lane in enumerate(road.lanes)}
    result = np.zeros((len(road.lanes), 2), np.float32)
    state = signals.state[:, -config.history_steps :]
    now = state[:, -1]
    changed = state != now[:, None]
    age = np.where(changed.any(axis=1), changed[:, ::-1].argmax(axis=1), state.shape[1]) * config.dt_s
    for light, lanes in enumerate(signals.lane_id):
        for lane in lanes:
            place = number.get(lane)
            if place is not None and now[light] != SignalState.UNKNOWN and now[light] > result[place, 0]:
                result[place] = now[light], age[light]
    return result
