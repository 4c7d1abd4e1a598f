"""Leaders and what follows from them: gap, time headway, time to collision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int32


@dataclass(frozen=True, eq=False)
class Leaders:
    """Per agent and frame: the index of its leader (-1: none) and the gap from bumper to bumper (NaN: none)."""

    leader: Int32[np.ndarray, "agent time"]
    gap_m: Float64[np.ndarray, "agent time"]


def corridor_leaders(
    position_m: Float[np.ndarray, "agent time 2"],
    direction: Float[np.ndarray, "agent time 2"],
    size_m: Float[np.ndarray, "agent 2"],
    *,
    is_ego: Bool[np.ndarray, "agent time"],
    is_other: Bool[np.ndarray, "agent time"],
    range_m: float,
    heading_within_rad: float,
) -> Leaders:
    """The leader of each ego where no lane says what its path is: who it would meet driving straight on.

    The corridor is straight along the direction of travel, as wide as both vehicles together, so that it uses
    neither the future nor a curvature estimate, whose noise would move the corridor by lanes at 50 m [ours].
    Overlapping vehicles have gap 0. Masks must be False where positions or directions are NaN.
    """
    from stylesim.kinematics.pair_kernels import corridor_scan

    leader = np.full(is_ego.shape, -1, np.int32)
    gap = np.full(is_ego.shape, np.nan)
    corridor_scan(
        position_m.astype(np.float64), direction.astype(np.float64), size_m.astype(np.float64), is_ego, is_other,
        range_m, float(np.cos(heading_within_rad)), leader, gap,
    )  # fmt: skip
    return Leaders(leader=leader, gap_m=gap)


def time_headway_s(gap_m: Float[np.ndarray, "*any"], speed_mps: Float[np.ndarray, "*any"]) -> Float[np.ndarray, "*any"]:
    """The follower's time gap: gap / its speed; inf where it stands, NaN where there is no leader."""
    moving = speed_mps > 0
    headway = gap_m / np.where(moving, speed_mps, 1.0)
    return np.where(moving, headway, np.where(np.isnan(gap_m) | np.isnan(speed_mps), np.nan, np.inf))


def time_to_collision_s(
    gap_m: Float[np.ndarray, "*any"],
    speed_mps: Float[np.ndarray, "*any"],
    leader_speed_mps: Float[np.ndarray, "*any"],
) -> Float[np.ndarray, "*any"]:
    """Gap / closing speed if both keep their speed; inf where it does not close, NaN where there is no leader."""
    closing = speed_mps - leader_speed_mps
    nearing = closing > 0
    time = gap_m / np.where(nearing, closing, 1.0)
    return np.where(nearing, time, np.where(np.isnan(gap_m) | np.isnan(closing), np.nan, np.inf))


def required_deceleration_mps2(
    gap_m: Float[np.ndarray, "*any"],
    speed_mps: Float[np.ndarray, "*any"],
    leader_speed_mps: Float[np.ndarray, "*any"],
) -> Float[np.ndarray, "*any"]:
    """What the follower must brake with so as not to touch a leader who keeps his speed: closing^2 / (2 gap).

    0 where it does not close, inf where there is no gap left, NaN where there is no leader. Also called the
    deceleration rate to avoid a crash (Cooper and Ferguson 1976 [recalled]).
    """
    closing = np.maximum(speed_mps - leader_speed_mps, 0.0)
    touching = gap_m <= 0
    needed = closing**2 / (2.0 * np.where(touching, 1.0, gap_m))
    return np.where(touching & (closing > 0), np.inf, needed)
