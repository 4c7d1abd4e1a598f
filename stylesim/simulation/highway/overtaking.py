"""Overtaking where somebody may come: on the lane of the oncoming traffic, in a gap that the driver accepts.

A driver who is held up pulls out if it would be back in its lane before it meets who comes, with a time to spare that
grows with the gaps that its style accepts; it passes who is in front, and those before him if there is no room between
them. It comes back as soon as there is room. Who sees that it would not be back in time, and is not level with
whom it passes yet, brakes and falls back behind him [ours].
"""

from __future__ import annotations

import math
from typing import Any

from stylesim.simulation.highway.graph import LaneIndex
from stylesim.simulation.highway.two_way import OWN, PASSING

LOOK_EVERY_S = 0.2  # chosen: a glance
CAUGHT_UP_S = 4.0  # chosen: beyond that time gap nobody is held up
HELD_UP_MPS = 3.0  # a neutral driver overtakes who is that much slower than it wishes; chosen: 10 km/h
FASTER_MPS = 5.3  # AASHTO's passing sight distance: who passes is 12 mph faster than who is passed [recalled]
LEAST_SPARE_S = 1.0  # AASHTO's clearance to who comes, at least [recalled]
SPARE_SHARE = 0.5  # of the accepted gap; chosen: 2.2 s to spare for a neutral driver
SIGHT_M = 700.0  # chosen: about the passing sight distance that roads of 100 km/h are marked for
POWER_SHARE = 0.4  # of the greatest acceleration, on average over a pass; chosen, because the wish comes nearer
PRESSED_ON = 1.1  # the wished speed is so much above that of the pass, which is then reached in finite time
MOST_PASSED = 3  # chosen: a longer queue is not passed at once
LAG_SHARE = 0.1  # of the accepted gap is the time gap to who was passed; chosen: half of that at a lane change
LANE_LEFT_M = 50.0  # to the end of the lane for overtaking, in the end
TOO_LATE_S = 0.5  # less than that to spare is too late
FALLS_BACK_MPS2 = 4.5  # as hard as people brake outside emergencies


def overtaking(car: Any) -> bool:
    """Whether the car is on the lane of who comes, or pulling out onto it."""
    return car.target_lane_index in car.road.graph.against


def choose_to_pass(car: Any) -> None:
    """Pull out, come back, or fall back; sets the target lane, `passing_mps`, `passes` and `falls_back` of the car."""
    if car.timer < LOOK_EVERY_S:
        return
    car.timer = 0.0
    edge = car.target_lane_index[:2]
    own, passing = (*edge, OWN), (*edge, PASSING)
    if not overtaking(car):
        if car.lane_index == own:
            _pull_out(car, own, passing)
        return
    if _may_return(car, own):
        car.target_lane_index, car.passing_mps, car.passes, car.falls_back = own, 0.0, None, False
    elif not car.falls_back:
        car.falls_back = _too_late(car, own, passing)


def _pull_out(car: Any, own: LaneIndex, passing: LaneIndex) -> None:
    queue = _queue(car, own)
    if not queue:
        return
    first_m, first = queue[0]
    gap_s = (first_m - (first.LENGTH + car.LENGTH) / 2) / max(car.speed, 1.0)
    held_up = car.free_wish_mps - first.speed >= HELD_UP_MPS / max(car.style.lane_change_eagerness, 1e-3)
    if gap_s > CAUGHT_UP_S or not held_up:
        return
    speed = max(car.free_wish_mps, first.speed + FASTER_MPS)
    way = _way(car, queue, speed)
    if way is None:
        return
    metres, passed = way
    seconds = car.style.lane_change_duration_s + _gaining_s(car, passed, metres, speed)
    run = passed.speed * seconds + metres
    lane_left = car.road.graph.length_m[own] - car.road.place(car, own)[0]
    if run + LANE_LEFT_M > lane_left or not _nobody_beside(car, passing, run):
        return
    coming, coming_mps = _coming(car, own, passing)
    spare = max(LEAST_SPARE_S, SPARE_SHARE * car.style.gap_acceptance_s)
    if coming >= run + coming_mps * seconds + spare * (coming_mps + speed):
        car.target_lane_index, car.passing_mps, car.passes = passing, PRESSED_ON * speed, passed


def _queue(car: Any, own: LaneIndex) -> list[tuple[float, Any]]:
    """(m from centre to centre, car) of who drives in front on the own lane, nearest first."""
    here = car.road.place(car, own)[0]
    return [
        (place - here, other)
        for place, other, along in car.road.occupants(own)
        if along and other is not car and place > here and not overtaking(other)
    ]


def _lag_m(car: Any, speed_mps: float) -> float:
    """What a driver leaves to who was passed, bumper to bumper."""
    return float(car.style.min_gap_m + LAG_SHARE * car.style.gap_acceptance_s * speed_mps)


def _way(car: Any, queue: list[tuple[float, Any]], speed_mps: float) -> tuple[float, Any] | None:
    """(m to gain on the last one passed, that one): up to the first room in the queue; None if there is none."""
    for number, (metres, other) in enumerate(queue[:MOST_PASSED]):
        if other.speed >= speed_mps - 1.0:
            return None
        beyond = (other.LENGTH + car.LENGTH) / 2 + _lag_m(car, other.speed)
        if number + 1 == len(queue) or queue[number + 1][0] - metres >= 2.0 * beyond:
            return metres + beyond, other
    return None


def _gaining_s(car: Any, passed: Any, metres: float, speed_mps: float) -> float:
    """Time to gain that many metres on who is passed, speeding up to that speed."""
    acceleration = POWER_SHARE * car.style.max_acceleration_mps2
    now, then = car.speed - passed.speed, speed_mps - passed.speed
    speeding_s = max(then - now, 0.0) / acceleration
    gained = (now + then) / 2 * speeding_s
    if gained >= metres:
        return float((-now + math.sqrt(now * now + 2.0 * acceleration * metres)) / acceleration)
    return float(speeding_s + (metres - gained) / max(then, 0.1))


def _nobody_beside(car: Any, passing: LaneIndex, run_m: float) -> bool:
    """Nobody of the own direction overtakes there."""
    here = car.road.place(car, passing)[0]
    return not any(
        along and other is not car and -_lag_m(car, other.speed) - other.LENGTH < place - here < run_m
        for place, other, along in car.road.occupants(passing)
    )


def _coming(car: Any, own: LaneIndex, passing: LaneIndex) -> tuple[float, float]:
    """(gap to who comes, on either lane, its speed); out of sight somebody may come at the limit."""
    here = car.road.place(car, own)[0]
    nearest, speed = SIGHT_M, float(car.lane.speed_limit)
    for lane in (passing, own):
        for place, other, along in car.road.occupants(lane):
            gap = place - here - (other.LENGTH + car.LENGTH) / 2
            if not along and place > here and gap < nearest:
                nearest, speed = gap, float(other.speed)
    return nearest, speed


def _may_return(car: Any, own: LaneIndex) -> bool:
    """There is room on the own lane: beyond whom it passes or, for who falls back, anywhere."""
    passed = _ahead_m(car, car.passes, own) < 0
    if not passed and not car.falls_back:
        return False
    front, front_gap = car.road.ahead(car, own)
    rear, rear_gap = car.road.behind(car, own)
    if rear is not None and rear_gap < _lag_m(car, max(rear.speed - car.speed, 0.0) + LAG_SHARE * rear.speed):
        return False
    lag_m = _lag_m(car, max(car.speed - front.speed, 0.0) + LAG_SHARE * car.speed) if front is not None else 0.0
    return bool(front is None or front_gap >= lag_m)


def _ahead_m(car: Any, other: Any, own: LaneIndex) -> float:
    """From centre to centre, to who is in front on the own lane; minus infinity where he has left the road."""
    if other is None or other not in car.road.vehicles:
        return -math.inf
    return float(car.road.place(other, own)[0] - car.road.place(car, own)[0])


def _too_late(car: Any, own: LaneIndex, passing: LaneIndex) -> bool:
    """It would meet who comes before it is back, and is not level with whom it passes."""
    metres = _ahead_m(car, car.passes, own)
    if metres < car.LENGTH / 2:
        return False
    beyond = (car.passes.LENGTH + car.LENGTH) / 2 + _lag_m(car, car.passes.speed)
    coming, coming_mps = _coming(car, own, passing)
    meets_s = coming / max(coming_mps + car.speed, 0.1)
    gaining_s = _gaining_s(car, car.passes, metres + beyond, car.passing_mps / PRESSED_ON)
    return gaining_s + car.style.lane_change_duration_s / 2 + TOO_LATE_S > meets_s
