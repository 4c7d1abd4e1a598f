"""Where somebody who crosses the road on foot meets which lanes, and when drivers should take it for an obstacle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from stylesim.road import Lane, Road
from stylesim.simulation.stressors import Attempt
from stylesim.simulation.walkers import Walker
from stylesim.tracks import AgentKind

REACH_M = 30.0  # beyond it nothing belongs to the same road
VERGE_M = 1.0  # walked beside the road before and after
ENDS_M = 15.0  # of a lane at its ends, where nobody crosses
GAP_M = 6.0  # a wider strip between two lanes is no part of the road
USUAL_LANE_M = 3.5  # where a map gives no width
ANTICIPATION_S = 2.0  # chosen: a driver takes who walks towards its lane for an obstacle that long before it is there
SIZE_M = {"jaywalker": (0.5, 0.5), "deer": (1.5, 0.5)}  # length and width; a fallow deer's body is about 1.5 m long
KIND = {"jaywalker": AgentKind.PEDESTRIAN, "deer": AgentKind.OTHER}


@dataclass(frozen=True)
class Crossed:
    """A lane on the walker's way: `aside_m` to the left of the victim's lane, `along_m` along its own centre line."""

    lane: Lane
    aside_m: float
    along_m: float

    @property
    def half_m(self) -> float:
        """Half of its width."""
        return (self.lane.width_m if np.isfinite(self.lane.width_m) else USUAL_LANE_M) / 2


@dataclass(frozen=True)
class Barrier:
    """When and where a driver on this lane has the walker in its way, s of the log and m along the lane."""

    lane_id: str
    along_m: float
    from_s: float
    until_s: float


def point_on(line: Float64[np.ndarray, "point 2"], along_m: float) -> tuple[Float64[np.ndarray, " 2"], float]:
    """The place so far along a polyline, and the heading there."""
    steps = np.diff(line, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    piece = int(np.clip(np.searchsorted(starts, along_m, side="right") - 1, 0, len(steps) - 1))
    share = (along_m - starts[piece]) / max(lengths[piece], 1e-9)
    return line[piece] + share * steps[piece], math.atan2(steps[piece, 1], steps[piece, 0])


def lanes_crossed(road: Road, lane_id: str, along_m: float) -> tuple[Crossed, ...]:
    """The lanes side by side with that place of a lane, from right to left; empty at a junction or a lane's end."""
    own = road.lane(lane_id)
    place, heading = point_on(own.centre_line_m.astype(np.float64), along_m)
    ahead, left = np.array([math.cos(heading), math.sin(heading)]), np.array([-math.sin(heading), math.cos(heading)])
    found: list[Crossed] = []
    for lane in road.lanes:
        line = lane.centre_line_m.astype(np.float64) - place
        if np.abs(line).min() > REACH_M:
            continue
        before, aside = line @ ahead, line @ left
        lengths = np.hypot(*np.diff(line, axis=0).T)
        for i in np.flatnonzero((before[:-1] <= 0) != (before[1:] <= 0)):
            share = before[i] / (before[i] - before[i + 1])
            offset = float(aside[i] + share * (aside[i + 1] - aside[i]))
            if abs(offset) <= REACH_M:
                found.append(Crossed(lane, offset, float(lengths[:i].sum() + share * lengths[i])))
    found.sort(key=lambda crossed: crossed.aside_m)
    here = min(range(len(found)), key=lambda i: abs(found[i].aside_m)) if found else -1
    if here < 0 or found[here].lane.lane_id != lane_id:
        return ()
    first = last = here
    while first > 0 and _touch(found[first - 1], found[first]):
        first -= 1
    while last + 1 < len(found) and _touch(found[last], found[last + 1]):
        last += 1
    side_by_side = tuple(found[first : last + 1])
    return () if any(crossed.lane.in_junction for crossed in side_by_side) else side_by_side


def _touch(right: Crossed, left: Crossed) -> bool:
    return left.aside_m - left.half_m - (right.aside_m + right.half_m) < GAP_M


def meeting_m(attempt: Attempt, speed_mps: float) -> float:
    """How far ahead of a driver of that speed the walker's way crosses its lane at the moment when it can be seen.

    With a response of 1 s (the median of Gates et al. 2007) the drawn deceleration stops the driver there.
    """
    return speed_mps * 1.0 + speed_mps**2 / (2.0 * attempt.numbers["needed_mps2"])


@dataclass(frozen=True)
class Meeting:
    """Somebody crosses the lanes `crossed` and meets who drives on the lane `lane_id`."""

    walker: Walker
    crossed: tuple[Crossed, ...]
    lane_id: str


def meeting(
    attempt: Attempt, road: Road, lane_id: str, *, from_m: float, speed_mps: float, now_s: float, name: str
) -> Meeting | None:
    """A walker who is in the middle of that lane a drawn moment before a driver who is there at `from_m` now would be.

    It comes from the nearer side, or from the other one by a chance of 1/4, walks up to the road while the driver can
    see it, and walks on until it has left the road. None where the lane ends or meets a junction before.
    """
    pace, before_s = attempt.numbers["speed_mps"], attempt.numbers["before_s"]
    distance = meeting_m(attempt, speed_mps)
    crossed = lanes_crossed(road, lane_id, from_m + distance)
    if not crossed:
        return None
    right, left = -(crossed[0].aside_m - crossed[0].half_m), crossed[-1].aside_m + crossed[-1].half_m
    from_right = (right <= left) == (attempt.numbers["side"] < 0.75)
    edge, beyond = (right, left) if from_right else (left, right)  # from the lane's centre to the sides of the road
    arrival_s = max(distance / speed_mps, (edge + VERGE_M) / pace + before_s)
    crossed = lanes_crossed(road, lane_id, from_m + speed_mps * arrival_s)
    own = next((item for item in crossed if item.lane.lane_id == lane_id), None)
    if own is None or not ENDS_M <= own.along_m <= length_m(own.lane) - ENDS_M:
        return None
    place, heading = point_on(own.lane.centre_line_m.astype(np.float64), own.along_m)
    across = np.array([-math.sin(heading), math.cos(heading)]) * (1.0 if from_right else -1.0)
    meets_s = arrival_s - before_s
    start = place - across * meets_s * pace
    length, width = SIZE_M[attempt.kind]
    walker = Walker(
        name=name,
        kind=KIND[attempt.kind],
        length_m=length,
        width_m=width,
        start_m=(float(start[0]), float(start[1])),
        heading_rad=math.atan2(across[1], across[0]),
        speed_mps=pace,
        begin_s=now_s,
        end_s=now_s + meets_s + (beyond + VERGE_M) / pace,
    )
    return Meeting(walker, crossed, lane_id)


def length_m(lane: Lane) -> float:
    """Length of a lane's centre line."""
    return float(np.hypot(*np.diff(lane.centre_line_m.astype(np.float64), axis=0).T).sum())


def barriers(met: Meeting) -> list[Barrier]:
    """For each lane the time in which drivers there have the walker in their way, and where.

    On the lane of who is to meet it from the moment when it comes into sight, on others from 2 s before it is there;
    until it has left the lane.
    """
    found, walker = [], met.walker
    across = np.array([math.cos(walker.heading_rad), math.sin(walker.heading_rad)])
    for item in met.crossed:
        place, _ = point_on(item.lane.centre_line_m.astype(np.float64), item.along_m)
        reach = float((place - np.array(walker.start_m)) @ across)
        enters = walker.begin_s + (reach - item.half_m - walker.length_m / 2) / walker.speed_mps
        leaves = walker.begin_s + (reach + item.half_m + walker.length_m / 2) / walker.speed_mps
        own = item.lane.lane_id == met.lane_id
        from_s = walker.begin_s if own else max(walker.begin_s, enters - ANTICIPATION_S)
        found.append(Barrier(item.lane.lane_id, item.along_m, from_s, leaves))
    return found
