"""Rows of a store as one agent-centric batch: pick the nearest, move to the target's frame at t0. No torch.

The same function makes the batches of training and of prediction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int64

from stylesim.forecasting.config import InputConfig
from stylesim.forecasting.snapshot import STATE_HEADING, STATE_VALID, STATE_VX, STATE_X
from stylesim.forecasting.store import SampleStore
from stylesim.tracks import AgentKind

AGENT_FEATURES = 7  # x, y, vx, vy, cos, sin of the heading, valid
AGENT_ATTRIBUTES = 3 + len(AgentKind)  # length, width, is the target, one-hot kind
SIGNAL_STATES = 5
PIECE_ATTRIBUTES = 8 + SIGNAL_STATES + 1  # as in the snapshot, one-hot signal, its age


@dataclass(frozen=True, eq=False)
class Batch:
    """Inputs in the frame of each sample's target at t0: origin at its centre, x along its heading. SI units."""

    agent: Float32[np.ndarray, "batch agent time 7"]  # agent 0 is the target
    agent_attribute: Float32[np.ndarray, "batch agent 11"]
    agent_valid: Bool[np.ndarray, "batch agent"]
    piece: Float32[np.ndarray, "batch piece point 2"]
    piece_attribute: Float32[np.ndarray, "batch piece 14"]
    piece_valid: Bool[np.ndarray, "batch piece"]
    pose: Float32[np.ndarray, "batch 3"]  # of the target in the scene's frame: x, y, heading
    agent_row: Int64[np.ndarray, "batch agent"]  # of the store

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.pose)


def to_target(
    xy: Float[np.ndarray, "batch *any 2"], heading: Float32[np.ndarray, " batch"]
) -> Float32[np.ndarray, "..."]:
    """Vectors turned from the scene's frame into that of the target."""
    shape = (-1, *(1,) * (xy.ndim - 2))
    c, s = np.cos(heading).reshape(shape), np.sin(heading).reshape(shape)
    x, y = xy[..., 0], xy[..., 1]
    return np.stack([c * x + s * y, c * y - s * x], axis=-1).astype(np.float32)


def to_scene(
    path: Float32[np.ndarray, "batch *any 2"], pose: Float32[np.ndarray, "batch 3"]
) -> Float32[np.ndarray, "..."]:
    """Points moved from the target's frame back to the scene's."""
    shape = (-1, *(1,) * (path.ndim - 2), 2)
    return to_target(path, -pose[:, 2]) + pose[:, :2].reshape(shape)


def _nearest(
    xy: Float32[np.ndarray, "row 2"],
    ranges: Int64[np.ndarray, "batch 2"],
    at: Float32[np.ndarray, "batch 2"],
    count: int,
) -> tuple[Int64[np.ndarray, "batch near"], Bool[np.ndarray, "batch near"]]:
    """For each sample the `count` rows of its range nearest to a point, and which of them exist."""
    start, size = ranges[:, 0], ranges[:, 1] - ranges[:, 0]
    offset = np.arange(max(int(size.max(initial=0)), 1))
    exists = offset < size[:, None]
    rows = np.where(exists, start[:, None] + offset, 0)
    if not len(xy):
        return np.zeros((len(at), count), np.int64), np.zeros((len(at), count), bool)
    x, y = xy[:, 0][rows] - at[:, :1], xy[:, 1][rows] - at[:, 1:]  # apart, which is faster than pairs
    squared = np.where(exists, x * x + y * y, np.float32(np.inf))
    # Floats that are not negative sort as their bits do: with the place behind them, a plain sort is a stable argsort.
    key = (squared.view(np.uint32).astype(np.uint64) << 32) | offset.astype(np.uint64)
    order = (np.sort(key, axis=1)[:, :count] & 0xFFFFFFFF).astype(np.int64)
    picked, found = np.take_along_axis(rows, order, 1), np.take_along_axis(exists, order, 1)
    missing = count - picked.shape[1]
    return np.pad(picked, ((0, 0), (0, max(missing, 0)))), np.pad(found, ((0, 0), (0, max(missing, 0))))


def gather(store: SampleStore, index: Int64[np.ndarray, " batch"], config: InputConfig) -> Batch:
    """The batch of the given samples."""
    snapshot, target, road = np.asarray(store.sample[index]).T
    pose = np.asarray(store.agent_pose[target])
    agent, attribute, agent_valid, agent_row = _agents(store, snapshot, target, pose, config)
    velocity = store.agent_state[target, -1, STATE_VX : STATE_VX + 2]
    ahead = pose[:, :2] + config.ahead_s * velocity
    piece, piece_attribute, piece_valid = _pieces(store, snapshot, road, pose, ahead, config)
    return Batch(agent, attribute, agent_valid, piece, piece_attribute, piece_valid, pose, agent_row)


def _in_frame(
    state: Float32[np.ndarray, "batch agent time 6"], pose: Float32[np.ndarray, "batch 3"]
) -> Float32[np.ndarray, "batch agent time 7"]:
    """States as the network takes them, all 0 where not seen; written in place, since this is most of `gather`."""
    x0, y0, turn = (column[:, None, None] for column in pose.T)
    c, s = np.cos(turn), np.sin(turn)
    out = np.empty((*state.shape[:3], AGENT_FEATURES), np.float32)
    for place, first, (u0, v0) in ((0, STATE_X, (x0, y0)), (2, STATE_VX, (0.0, 0.0))):
        u, v = state[..., first] - u0, state[..., first + 1] - v0
        out[..., place], out[..., place + 1] = c * u + s * v, c * v - s * u
    heading = state[..., STATE_HEADING] - turn
    out[..., 4], out[..., 5] = np.cos(heading), np.sin(heading)
    out[..., 6] = state[..., STATE_VALID]
    out[..., :6] *= out[..., 6:]
    return out


def _agents(
    store: SampleStore,
    snapshot: Int64[np.ndarray, " batch"],
    target: Int64[np.ndarray, " batch"],
    pose: Float32[np.ndarray, "batch 3"],
    config: InputConfig,
) -> tuple[
    Float32[np.ndarray, "batch agent time 7"],
    Float32[np.ndarray, "batch agent 11"],
    Bool[np.ndarray, "batch agent"],
    Int64[np.ndarray, "batch agent"],
]:
    rows, valid = _nearest(store.agent_pose[:, :2], store.snapshot_agents[snapshot], pose[:, :2], config.agents)
    # Agents on one spot (a simulator's fault) must not push the target from its place.
    elsewhere = np.where(rows[:, 1:] == target[:, None], rows[:, :1], rows[:, 1:])
    rows = np.concatenate([target[:, None], elsewhere], axis=1)
    agent = _in_frame(np.asarray(store.agent_state[rows]), pose)
    agent *= valid[..., None, None]  # states are finite, and 0 where the agent was not seen
    raw = np.asarray(store.agent_attribute[rows])
    kind = raw[..., 2:] == np.arange(len(AgentKind), dtype=np.float32)
    is_target = np.broadcast_to(np.arange(config.agents) == 0, rows.shape)
    attribute = np.concatenate([raw[..., :2], is_target[..., None], kind], axis=-1).astype(np.float32)
    attribute[~valid] = 0.0
    return agent, attribute, valid, rows


def _pieces(
    store: SampleStore,
    snapshot: Int64[np.ndarray, " batch"],
    road: Int64[np.ndarray, " batch"],
    pose: Float32[np.ndarray, "batch 3"],
    at: Float32[np.ndarray, "batch 2"],
    config: InputConfig,
) -> tuple[
    Float32[np.ndarray, "batch piece point 2"], Float32[np.ndarray, "batch piece 14"], Bool[np.ndarray, "batch piece"]
]:
    ranges = np.zeros((len(road), 2), np.int64)
    ranges[road >= 0] = store.road_pieces[road[road >= 0]]
    rows, valid = _nearest(store.piece_middle, ranges, at, config.polylines)
    shape = (*rows.shape, config.points, 2)
    attributes = np.zeros((*rows.shape, PIECE_ATTRIBUTES), np.float32)
    if not valid.any():
        return np.zeros(shape, np.float32), attributes, valid
    points = to_target(store.piece_points[rows] - pose[:, None, None, :2], pose[:, 2])
    raw = np.asarray(store.piece_attribute[rows])
    attributes[..., :6] = raw[..., :6]
    stop = to_target(raw[..., 6:8] - pose[:, None, :2], pose[:, 2])
    attributes[..., 6:8] = np.where(raw[..., 5:6] > 0, stop, 0.0)
    run = store.snapshot_lanes[snapshot]
    if len(store.lane_signal):
        lane = np.where(run[:, None] >= 0, run[:, None] + store.piece_lane[rows], 0)
        light = np.where((valid & (run[:, None] >= 0))[..., None], store.lane_signal[np.where(valid, lane, 0)], 0.0)
    else:
        light = np.zeros((*rows.shape, 2), np.float32)
    attributes[..., 8 : 8 + SIGNAL_STATES] = light[..., :1] == np.arange(SIGNAL_STATES)
    attributes[..., -1] = light[..., 1]
    points[~valid], attributes[~valid] = 0.0, 0.0
    return points, attributes, valid
