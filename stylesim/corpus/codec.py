"""Tracks as integer columns and back.

Rows are the valid frames, sorted by agent, then frame. Units: position 1 mm, velocity 1 cm/s, heading 1 mrad.
Per (scene, agent), so that any track decodes alone:

* `frame`: first row the frame number, then the difference to the row before.
* `ddx`, `ddy`: first row the position; second row its difference to the first; then second differences.
* `rvx`, `rvy`: velocity minus floor(position difference * 100000 / (frame difference * dt in microseconds)),
  with a position difference of 0 in the first row. (Motion explains velocity but for rounding, so this is small.)
* `dh`: first row the heading, then the difference to the row before, of the unwrapped angle.
* `lookahead`: how many frames ahead the value reaches, as it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Int, Int64

from stylesim.errors import CorpusError
from stylesim.geometry import wrap_angle
from stylesim.tracks import Tracks

# What one unit of a stored integer is; chosen: finer than any sensor or tracker resolves (docs/corpus_format.md).
POSITION_M = 0.001
VELOCITY_MPS = 0.01
HEADING_RAD = 0.001
COLUMNS = ("agent", "frame", "ddx", "ddy", "rvx", "rvy", "dh", "lookahead")
_LIMIT = 2**29  # second differences of anything smaller fit in 32 bits

Columns = dict[str, Int[np.ndarray, " row"]]


def _starts(agent: Int[np.ndarray, " row"]) -> Int64[np.ndarray, " group"]:
    """The first row of each agent."""
    if not len(agent):
        return np.zeros(0, np.int64)
    return np.concatenate([[0], np.flatnonzero(np.diff(agent)) + 1]).astype(np.int64)


def _difference(values: Int64[np.ndarray, " row"], starts: Int64[np.ndarray, " group"]) -> Int64[np.ndarray, " row"]:
    """Difference to the row before; the value itself in each group's first row."""
    result = values.copy()
    result[1:] -= values[:-1]
    result[starts] = values[starts]
    return result


def _cumulate(values: Int64[np.ndarray, " row"], starts: Int64[np.ndarray, " group"]) -> Int64[np.ndarray, " row"]:
    """The inverse of `_difference`."""
    total = np.cumsum(values)
    base = np.where(starts > 0, total[starts - 1], 0)
    return total - np.repeat(base, np.diff(np.append(starts, len(values))))


def _predicted_velocity(
    step: Int64[np.ndarray, " row"], frame_step: Int64[np.ndarray, " row"], dt_us: int
) -> Int64[np.ndarray, " row"]:
    return (step * 100_000) // (frame_step * dt_us)


def encode(tracks: Tracks) -> Columns:
    """The columns of one scene, int64. CorpusError for positions beyond 500 km from the scene's origin."""
    agent, frame = np.nonzero(tracks.valid)
    position = tracks.position_m[agent, frame].astype(np.float64)
    velocity = tracks.velocity_mps[agent, frame].astype(np.float64)
    heading = tracks.heading_rad[agent, frame].astype(np.float64)
    for name, values, scale in (
        ("position", position, POSITION_M),
        ("velocity", velocity, VELOCITY_MPS),
        ("heading", heading, HEADING_RAD),
    ):
        if len(values) and not (np.isfinite(values).all() and np.abs(values).max() < _LIMIT * scale):
            raise CorpusError(f"{name} is not finite, or too large for the format, where valid is True; shift origin_m")
    starts = _starts(agent)
    frames = _difference(frame.astype(np.int64), starts)
    xy = np.rint(position / POSITION_M).astype(np.int64)
    v = np.rint(velocity / VELOCITY_MPS).astype(np.int64)
    columns: Columns = {"agent": agent, "frame": frames}
    dt_us = round(tracks.dt_s * 1e6)
    safe = np.where(frames > 0, frames, 1)
    safe[starts] = 1
    for axis, label in ((0, "x"), (1, "y")):
        step = _difference(xy[:, axis], starts)
        first = step[starts].copy()
        step[starts] = 0
        second = _difference(step, starts)
        second[starts] = first
        columns[f"dd{label}"] = second
        columns[f"rv{label}"] = v[:, axis] - _predicted_velocity(step, safe, dt_us)
    columns["dh"] = _difference(np.rint(_unwrapped(heading, starts) / HEADING_RAD).astype(np.int64), starts)
    ahead = tracks.lookahead_steps
    columns["lookahead"] = np.zeros(len(agent), np.int64) if ahead is None else ahead[agent, frame].astype(np.int64)
    return columns


def _unwrapped(angle: np.ndarray, starts: Int64[np.ndarray, " group"]) -> np.ndarray:
    """The angle of each group without jumps of 2 pi."""
    if not len(angle):
        return angle
    turn = np.zeros(len(angle))
    turn[1:] = -np.rint(np.diff(angle) / (2 * np.pi))
    turn[starts] = 0
    total = np.cumsum(turn)
    base = np.repeat(total[starts], np.diff(np.append(starts, len(angle))))
    return angle + 2 * np.pi * (total - base)


def decode(columns: Columns, tracks: Tracks) -> Tracks:
    """`tracks` (agents and an all-invalid clock) filled from the columns. CorpusError if they do not fit it."""
    agent = columns["agent"].astype(np.int64)
    starts = _starts(agent)
    frames = columns["frame"].astype(np.int64)
    frame = _cumulate(frames, starts)
    if len(agent) and not (
        0 <= agent.min() <= agent.max() < tracks.n_agents and 0 <= frame.min() <= frame.max() < tracks.n_frames
    ):
        raise CorpusError("a row names an agent or frame that the scene does not have")
    safe = np.where(frames > 0, frames, 1)
    safe[starts] = 1
    dt_us = round(tracks.dt_s * 1e6)
    shape = (tracks.n_agents, tracks.n_frames)
    position = np.full((*shape, 2), np.nan, np.float32)
    velocity = np.full((*shape, 2), np.nan, np.float32)
    heading = np.full(shape, np.nan, np.float32)
    for axis, label in ((0, "x"), (1, "y")):
        second = columns[f"dd{label}"].astype(np.int64)
        first = second[starts].copy()
        second[starts] = 0
        step = _cumulate(second, starts)
        whole = step.copy()
        whole[starts] = first
        position[agent, frame, axis] = _cumulate(whole, starts) * POSITION_M
        v = columns[f"rv{label}"].astype(np.int64) + _predicted_velocity(step, safe, dt_us)
        velocity[agent, frame, axis] = v * VELOCITY_MPS
    heading[agent, frame] = wrap_angle(_cumulate(columns["dh"].astype(np.int64), starts) * HEADING_RAD)
    valid = np.zeros(shape, bool)
    valid[agent, frame] = True
    ahead = None
    if np.any(columns["lookahead"]):
        ahead = np.zeros(shape, np.int16)
        ahead[agent, frame] = columns["lookahead"]
    return replace(
        tracks, position_m=position, velocity_mps=velocity, heading_rad=heading, valid=valid, lookahead_steps=ahead
    )
