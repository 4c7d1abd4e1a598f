"""What happened to whom: flags per driver and counts per episode, from the log and what SUMO reported."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Bool, Int32, Int64

from stylesim.road import Lane
from stylesim.signals import Signals, SignalState
from stylesim.simulation.sumo.bodies import Bodies
from stylesim.simulation.sumo.episode import DT_S
from stylesim.simulation.sumo.recorder import RawLog
from stylesim.simulation.sumo.yellow import DecisionEvent
from stylesim.tracks import TrackFlag

HARD_BRAKING_MPS2 = 6.0  # chosen, because 85 % of drivers stop at a yellow with less than 3.9, and 5.9 is a late stop
STANDING_MPS = 0.3
AT_LINE_M = 5.0  # the first in a queue stands this close; chosen, because minGap and a car's hesitation fit in
NEAR_LANE_M = 0.6  # beyond half a lane's width, for who is changing lanes


def _set(flags: Int32[np.ndarray, " driver"], who: Int32[np.ndarray, " hit"], flag: TrackFlag) -> None:
    np.bitwise_or.at(flags, who, np.int32(flag))


def flags_of(
    bodies: Bodies,
    log: RawLog,
    *,
    logged: Bool[np.ndarray, " row"],
    first_step: int,
    signals: Signals | None,
    lanes: dict[str, Lane],
    decisions: Iterable[DecisionEvent],
) -> Int32[np.ndarray, " driver"]:
    """The `TrackFlag`s of every driver; only what happened at a logged row of that driver counts.

    `signals` holds the states from simulation step `first_step` on, frame by frame.
    """
    flags = np.zeros(len(log.driver_ids), np.int32)
    number = {name: index for index, name in enumerate(log.driver_ids)}
    seen = logged_steps(bodies, logged, len(log.driver_ids))
    reported = [(step, name, TrackFlag.COLLIDED) for step, *pair in log.collisions for name in pair]
    reported += [(step, name, TrackFlag.EMERGENCY_BRAKED) for step, name in log.emergency_stops]
    reported += [(step, name, TrackFlag.TELEPORTED) for step, name in log.teleports]
    reported += [(step - 1, name, TrackFlag.REMOVED) for step, name in log.removed]
    kinds = {True: TrackFlag.DECIDED_STOP, False: TrackFlag.DECIDED_GO}
    reported += [(event.step, event.driver_id, kinds[event.stop]) for event in decisions]
    for step, name, flag in reported:
        who = number.get(name, -1)
        if who >= 0 and seen[who, 0] <= step <= seen[who, 1]:
            flags[who] |= int(flag)
    braking = bodies.segments.change(bodies.speed_mps) <= -HARD_BRAKING_MPS2 * DT_S
    _set(flags, bodies.driver[braking & logged], TrackFlag.EMERGENCY_BRAKED)
    if signals is not None:
        for row, (lane_id,) in enumerate(signals.lane_id):
            _flag_line(flags, bodies, logged, lane=lanes[lane_id], state=signals.state[row], first_step=first_step)
    return flags


def logged_steps(bodies: Bodies, logged: Bool[np.ndarray, " row"], drivers: int) -> Int64[np.ndarray, "driver 2"]:
    """First and last logged step of each driver; (1, 0) for who has none."""
    seen = np.tile(np.array([1, 0], np.int64), (drivers, 1))
    rows = np.flatnonzero(logged)
    if not len(rows):
        return seen
    who = bodies.driver[rows]
    new = np.flatnonzero(np.diff(who, prepend=-1))
    seen[who[new], 0] = bodies.step[rows[new]]
    last = np.append(new[1:], len(rows)) - 1
    seen[who[last], 1] = bodies.step[rows[last]]
    return seen


def _flag_line(
    flags: Int32[np.ndarray, " driver"],
    bodies: Bodies,
    logged: Bool[np.ndarray, " row"],
    *,
    lane: Lane,
    state: np.ndarray,
    first_step: int,
) -> None:
    """Crossed on yellow, ran red (front over the line 0.1 s after the onset of red or later), stopped at the line."""
    end = lane.centre_line_m[-1].astype(np.float64)
    ahead = end - lane.centre_line_m[-2]
    ahead /= np.hypot(*ahead)
    reach = AT_LINE_M + 5.0
    near = np.flatnonzero(logged & (np.abs(bodies.front_m - end) <= reach).all(axis=1))
    rest = bodies.front_m[near] - end
    along = rest @ ahead
    side = np.abs(rest[:, 1] * ahead[0] - rest[:, 0] * ahead[1]) <= lane.width_m / 2 + NEAR_LANE_M
    frame = np.clip(bodies.step[near] - first_step, 1, len(state) - 1)
    moved = (bodies.segments.change(bodies.front_m)[near] if len(near) else rest) @ ahead
    crossed = side & (along > 0) & (along - moved <= 0)
    who = bodies.driver[near]
    _set(flags, who[crossed & (state[frame] == SignalState.YELLOW)], TrackFlag.CROSSED_ON_YELLOW)
    red = (state[frame] == SignalState.RED) & (state[frame - 1] == SignalState.RED)
    _set(flags, who[crossed & red], TrackFlag.RAN_RED)
    held = (state[frame] == SignalState.RED) | (state[frame] == SignalState.YELLOW)
    standing = side & (along <= 0.5) & (along >= -AT_LINE_M) & (bodies.speed_mps[near] < STANDING_MPS) & held
    _set(flags, who[standing], TrackFlag.STOPPED_AT_LINE)
