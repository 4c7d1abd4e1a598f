"""What is in a driver's way: who is ahead on its path, and who will cross it first."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from stylesim.geometry import wrap_angle
from stylesim.simulation.rollout.path import SPACING_M, Path

LOOK_M = 120.0  # chosen: beyond it a leader changes the acceleration by less than 0.1 m/s2 in towns
SIDE_M = 0.3  # what drivers leave beside somebody who moves
OPPOSITE_RAD = math.radians(120.0)  # who comes towards a driver is no leader unless it is in the middle of its way
OPPOSITE_M = 0.8
HEAD_ON_RAD = math.radians(150.0)  # nobody gives way to who comes straight towards it
AHEAD_S = np.arange(0.0, 5.01, 0.25)  # where others will be is looked up so often; chosen: 5 s pass a junction
FINER_S = 0.05  # and interpolated so finely between
MOMENTS_S = np.arange(0.0, 5.001, FINER_S)
MOST_STEP_M = 15.0  # in 0.25 s nobody moves farther
STANDS_MPS = 0.5
SHARE_OF_GAP = 0.5  # of the accepted gap that is left before and after somebody who crosses; chosen: accepted gaps are
# between two vehicles of the major stream, so about half lies on either side
PASSED_S = 1.0  # who will have passed so long before is no matter
KEEPS_M = 1.0  # before the way of who crosses


@dataclass(frozen=True, eq=False)
class Others:
    """Everybody else in one frame."""

    place_m: Float64[np.ndarray, "other 2"]
    velocity_mps: Float64[np.ndarray, "other 2"]
    heading_rad: Float64[np.ndarray, " other"]
    size_m: Float64[np.ndarray, "other 2"]
    acceleration_mps2: Float64[np.ndarray, " other"]
    rank: Float64[np.ndarray, " other"]  # of two who would meet the lower one goes first
    ahead_m: Float64[np.ndarray, "other moment 2"]  # where they will be at the moments `AHEAD_S`


@dataclass(frozen=True)
class InTheWay:
    """The nearest thing ahead: gap from bumper to bumper, its speed and acceleration along the path."""

    gap_m: float = math.inf
    speed_mps: float = 0.0
    acceleration_mps2: float = 0.0


def near(others: Others, place_m: Float64[np.ndarray, " 2"]) -> Others:
    """Those within reach."""
    keep = np.abs(others.place_m - place_m).max(axis=1) < LOOK_M if len(others.place_m) else np.zeros(0, bool)
    return Others(**{name: getattr(others, name)[keep] for name in Others.__dataclass_fields__})


def leader(path: Path, s_m: float, length_m: float, width_m: float, others: Others) -> InTheWay:
    """Who is ahead on the path and reaches into it."""
    if not len(others.place_m):
        return InTheWay()
    along, left = path.project(others.place_m)
    course = np.interp(along, path.s_m, path.heading_rad)
    turned = wrap_angle(others.heading_rad - course)
    across = (others.size_m[:, 0] * np.abs(np.sin(turned)) + others.size_m[:, 1] * np.abs(np.cos(turned))) / 2
    lengthwise = (others.size_m[:, 0] * np.abs(np.cos(turned)) + others.size_m[:, 1] * np.abs(np.sin(turned))) / 2
    speed = np.hypot(others.velocity_mps[:, 0], others.velocity_mps[:, 1])
    side = np.where(speed > STANDS_MPS, SIDE_M, -0.1)
    in_way = np.abs(left) < across + width_m / 2 + side
    in_way &= (np.abs(turned) < OPPOSITE_RAD) | (np.abs(left) < OPPOSITE_M)
    gap = along - s_m - lengthwise - length_m / 2
    in_way &= (along > s_m) & (gap < LOOK_M) & (along <= path.length_m + 5.0)
    if not in_way.any():
        return InTheWay()
    first = int(np.flatnonzero(in_way)[np.argmin(gap[in_way])])
    pace = float(others.velocity_mps[first] @ np.array([math.cos(course[first]), math.sin(course[first])]))
    return InTheWay(float(gap[first]), max(pace, 0.0), float(others.acceleration_mps2[first]))


def crossing_gap_m(
    path: Path,
    s_m: float,
    length_m: float,
    width_m: float,
    speed_mps: float,
    *,
    gap_s: float,
    bold_mps2: float,
    rank: float,
    others: Others,
) -> float:
    """To the way of who crosses the path, or joins it, and goes first, from the front bumper; infinite for nobody.

    Where somebody will be is `ahead_m`. A driver lets pass who would be at the common place less than half of its
    accepted gap after it could be there itself, or a second before, and has the lower `rank` (recorded road users
    have the lowest, because nobody can stop them; who turns gives way to who goes straight on).
    """
    if not len(others.place_m):
        return math.inf
    now, aside = path.project(others.place_m)
    speed = np.hypot(others.velocity_mps[:, 0], others.velocity_mps[:, 1])
    on_path = (np.abs(aside) < (others.size_m[:, 1] + width_m) / 2) & (now > s_m)
    first = int(np.searchsorted(path.s_m, s_m + length_m / 2))
    own = path.point_m[first : first + round(LOOK_M / SPACING_M)]
    if not len(own):
        return math.inf
    nearest = math.inf
    for other in np.flatnonzero((speed > STANDS_MPS) & (others.rank < rank) & ~on_path):
        theirs = others.ahead_m[other]
        reach = (others.size_m[other, 1] + width_m) / 2 + SIDE_M
        apart = np.abs(own[:, None] - theirs).max(axis=-1)
        if apart.min() > reach + MOST_STEP_M:
            continue
        entry = _meet(own, theirs, reach)
        if entry is None or _head_on(path, first + entry[0], theirs, entry[1]):
            continue
        gap = float(path.s_m[first + entry[0]]) - s_m - length_m / 2
        early_s = _earliest_s(gap, speed_mps, bold_mps2)
        if -PASSED_S <= float(MOMENTS_S[entry[1]]) - early_s <= SHARE_OF_GAP * gap_s:
            nearest = min(nearest, gap - KEEPS_M)
    return nearest


def _meet(own: np.ndarray, theirs: np.ndarray, reach_m: float) -> tuple[int, int] | None:
    """(first point of the own path, first of their moments) that are that near to any of the other's."""
    fine = np.stack([np.interp(MOMENTS_S, AHEAD_S, theirs[:, axis]) for axis in (0, 1)], axis=1)
    hits = ((own[:, None] - fine) ** 2).sum(axis=-1) < reach_m**2
    if not hits.any():
        return None
    return int(np.argmax(hits.any(axis=1))), int(np.argmax(hits.any(axis=0)))


def _head_on(path: Path, point: int, theirs: np.ndarray, moment: int) -> bool:
    """True where the two would meet face to face: a driver that gave way then would never move again."""
    steps = np.gradient(theirs, axis=0)
    step = steps[min(int(moment * FINER_S / (AHEAD_S[1] - AHEAD_S[0])), len(steps) - 1)]
    course = math.atan2(step[1], step[0])
    turned = abs(float(wrap_angle(np.array(course - path.heading_rad[min(point, len(path.s_m) - 1)]))))
    return turned > HEAD_ON_RAD


def _earliest_s(distance_m: float, speed_mps: float, bold_mps2: float) -> float:
    """The time that a driver needs at least who accelerates as much as it likes to."""
    return (math.sqrt(speed_mps**2 + 2.0 * bold_mps2 * max(distance_m, 0.0)) - speed_mps) / bold_mps2
