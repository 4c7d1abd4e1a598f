"""Who drives near whom, and how fast one closes on the others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, Int32

from stylesim.kinematics.smoothing import Motion


@dataclass(frozen=True, eq=False)
class Closing:
    """Per agent and frame: the sum of max(0, (v - v_n) / distance) over its neighbours, and their number."""

    rate_per_s: Float[np.ndarray, "agent time"]
    count: Int32[np.ndarray, "agent time"]


def displaced(
    position_m: Float[np.ndarray, "agent time 2"], run: Int[np.ndarray, "agent time"], more_than_m: float
) -> Bool[np.ndarray, "agent time"]:
    """True in every frame of a run in which the agent came further than that from where the run began.

    Tells parked vehicles from traffic [ours: 1 m in the window]. `run` as in `smoothing.derivatives`; runs of one
    number that are interrupted count together.
    """
    from stylesim.kinematics.pair_kernels import left_its_place

    moved = np.zeros(run.shape, bool)
    left_its_place(position_m, run, more_than_m, moved)
    return moved


def closing_on_neighbours(
    motion: Motion,
    *,
    is_ego: Bool[np.ndarray, "agent time"],
    is_neighbour: Bool[np.ndarray, "agent time"],
    radius_m: float,
    heading_within_rad: float,
    distance_floor_m: float,
) -> Closing:
    """How fast each ego closes on its neighbours, weighed by nearness; 0 and count 0 where it has none.

    A neighbour is within `radius_m` (centre to centre) and drives within `heading_within_rad` of the ego's
    direction. The work is sparse: a sweep along the axis on which a frame's vehicles spread most.
    """
    from stylesim.kinematics.pair_kernels import closing_sums

    known = motion.known
    rate = np.zeros(known.shape)
    count = np.zeros(known.shape, np.int32)
    closing_sums(
        motion.position_m, motion.direction, motion.speed_mps, is_ego & known, is_neighbour & known,
        radius_m, float(np.cos(heading_within_rad)), distance_floor_m, rate, count,
    )  # fmt: skip
    return Closing(rate_per_s=rate, count=count)
