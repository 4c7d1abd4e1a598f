"""Do position, velocity and heading of a track agree with each other, and does nothing teleport?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from stylesim.geometry import wrap_angle
from stylesim.overlaps import overlaps
from stylesim.tracks import Tracks

MAX_SPEED_MPS = 75.0  # chosen, because 270 km/h is beyond public roads
MAX_VELOCITY_ERROR_MPS = 3.0  # chosen: several times the noise of camera and lidar trackers (about 0.5 m/s)
AGREEMENT_S = 0.5  # chosen: over one frame of 0.1 s, 0.3 m of position noise would look like 3 m/s
MAX_SLIP_RAD = np.deg2rad(60.0)  # chosen: no road car slides at such an angle
MOVING_MPS = 3.0  # below it a heading cannot be told from noise; chosen


@dataclass(frozen=True, eq=False)
class Implausible:
    """Where a scene contradicts physics, per agent and frame."""

    teleport: Bool[np.ndarray, "agent time"]
    velocity: Bool[np.ndarray, "agent time"]
    heading: Bool[np.ndarray, "agent time"]

    @property
    def agents(self) -> Bool[np.ndarray, " agent"]:
        """Agents with any such frame."""
        return (self.teleport | self.velocity | self.heading).any(axis=1)


def implausible(tracks: Tracks) -> Implausible:
    """Frames that jump faster than MAX_SPEED_MPS, whose velocity differs from the displacement, or that slide.

    Velocity is held against the displacement over AGREEMENT_S, by the mean of the velocities in between.
    Headings are judged for motor vehicles above MOVING_MPS only.
    """
    both = tracks.valid[:, 1:] & tracks.valid[:, :-1]
    moved = np.diff(tracks.position_m.astype(np.float64), axis=1) / tracks.dt_s
    zero = np.zeros(tracks.valid.shape, bool)
    teleport, velocity, heading = zero.copy(), zero.copy(), zero.copy()
    with np.errstate(invalid="ignore"):
        teleport[:, 1:] = both & (np.hypot(moved[..., 0], moved[..., 1]) > MAX_SPEED_MPS)
        velocity[:] = _disagreement(tracks, teleport) > MAX_VELOCITY_ERROR_MPS
        fast = tracks.valid & tracks.is_motor[:, None] & (tracks.speed_mps > MOVING_MPS)
        vx, vy = tracks.velocity_mps[fast].T
        heading[fast] = np.abs(wrap_angle(np.arctan2(vy, vx) - tracks.heading_rad[fast])) > MAX_SLIP_RAD
    return Implausible(teleport, velocity, heading)


def _disagreement(tracks: Tracks, teleport: Bool[np.ndarray, "agent time"]) -> Float[np.ndarray, "agent time"]:
    """Mean velocity minus displacement over the AGREEMENT_S that end at each frame, m/s; 0 where a frame is missing."""
    steps = max(1, round(AGREEMENT_S / tracks.dt_s))
    result = np.zeros(tracks.valid.shape)
    if tracks.n_frames <= steps:
        return result
    sound = tracks.valid & ~teleport
    whole = sound[:, steps:].copy()
    for earlier in range(steps):
        whole &= sound[:, earlier : earlier - steps]
    between = (tracks.velocity_mps[:, 1:] + tracks.velocity_mps[:, :-1]).astype(np.float64) / 2
    between[np.isnan(between)] = 0.0
    summed = np.zeros((tracks.n_agents, tracks.n_frames, 2))
    np.cumsum(between, axis=1, out=summed[:, 1:])
    meant = (summed[:, steps:] - summed[:, :-steps]) / steps
    moved = (tracks.position_m[:, steps:] - tracks.position_m[:, :-steps]).astype(np.float64) / (steps * tracks.dt_s)
    apart = (moved - meant)[whole]
    result[:, steps:][whole] = np.hypot(apart[:, 0], apart[:, 1])
    return result


def overlapping_pairs(tracks: Tracks, *, every: int = 1) -> int:
    """How many pairs of motor vehicles' boxes overlap in at least one of every `every`-th frame."""
    frames = np.arange(0, tracks.n_frames, every)
    agent, place = np.nonzero(tracks.valid[:, frames] & tracks.is_motor[:, None])
    frame = frames[place]
    found = overlaps(
        frame, agent, tracks.position_m[agent, frame], tracks.heading_rad[agent, frame], tracks.size_m[agent]
    )
    return len({(int(min(a, b)), int(max(a, b))) for _, a, b in found})
