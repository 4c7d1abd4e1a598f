"""Which lane a driver takes: MOBIL where it may choose, its route where it must.

MOBIL as in highway-env (Kesting, Treiber, Helbing 2007), with the driver's own thresholds; a change also needs a gap
in front and behind that the driver accepts. Who must change (its lane ends, or its exit comes) looks from farther
away the more patient it is, and takes smaller gaps as the place comes nearer, down to half [ours].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stylesim.simulation.highway.following import LEAST_GAP_M
from stylesim.simulation.highway.graph import LaneGraph, LaneIndex
from stylesim.simulation.highway.overtaking import choose_to_pass
from stylesim.simulation.highway.two_way import PASSING

MOBIL_GAIN_MPS2 = 0.2  # highway-env's threshold, an average driver's
MOBIL_SAFE_MPS2 = 2.0  # highway-env's imposed braking, an average driver's
NEUTRAL_GAP_S = 4.5  # gap acceptance of the neutral driver in agents/styles.yaml
EVERY_S = 1.0  # highway-env's: lane changes are thought of once a second
KEEP_RIGHT_MPS2 = 0.3  # bias of MOBIL's European rule (Kesting, Treiber, Helbing 2007 [recalled])
LEAST_MPS = 1.0  # highway-env's: who is slower does not change lanes, unless it must
ACCEPTED_SHARE = 0.2  # chosen: accepted lag is 0.9 s for the neutral gap of 4.5 s; observed median 0.8-1.5 s
EARLIEST_M, LATEST_M = 1000.0, 300.0  # exits are announced 1000 m ahead; chosen: the boldest act in the last 300 m
MUST_HARDER = 1.0  # chosen: at the end of its lane a driver imposes twice the braking that it imposes by choice

Needs = Mapping[LaneIndex, tuple[int, float]]


def lane_needs(graph: LaneGraph, edges: Sequence[tuple[str, str]]) -> Needs:
    """For each lane of a route's roads: (changes still needed, right positive; m after its end to do them in).

    Worked out from the last road to the first: a lane that goes on needs what its successor needs; one that does not
    needs a change to the nearest lane that does, before its own end.
    """
    needs: dict[LaneIndex, tuple[int, float]] = {}
    for place in range(len(edges) - 1, -1, -1):
        start, end = edges[place]
        count = graph.beside[start, end]
        if place == len(edges) - 1:
            needs |= {(start, end, lane): (0, 0.0) for lane in range(count)}
            continue
        onward: dict[int, LaneIndex] = {}
        for lane in range(count):
            touching = [other for other in graph.after[start, end, lane] if other[:2] == edges[place + 1]]
            if touching:
                onward[lane] = touching[0]
        for lane in range(count):
            if lane in onward:
                changes, beyond = needs[onward[lane]]
                needs[start, end, lane] = changes, beyond + graph.length_m[onward[lane]] if changes else 0.0
            elif onward:
                nearest = min(onward, key=lambda other: abs(other - lane))
                needs[start, end, lane] = nearest - lane, 0.0
    return needs


def must_change(car: Any) -> tuple[int, float]:
    """(changes that the car's way asks for, right positive; m left to make them); (0, 0) where it may stay."""
    if car.needs is None or car.target_lane_index not in car.needs:
        return 0, 0.0
    changes, beyond = car.needs[car.target_lane_index]
    if not changes:
        return 0, 0.0
    return changes, beyond + car.road.graph.length_m[car.target_lane_index] - car.road.place(
        car, car.target_lane_index
    )[0]


def choose_lane(car: Any) -> None:
    """Change the car's target lane where that pays, or where it must; takes back a change that somebody else makes."""
    road = car.road
    if (*car.target_lane_index[:2], PASSING) in road.graph.against:
        choose_to_pass(car)
        return
    if car.lane_index != car.target_lane_index:
        if car.lane_index[:2] == car.target_lane_index[:2]:
            _give_way(car)
        return
    if car.timer < EVERY_S:
        return
    car.timer = 0.0
    changes, left_m = must_change(car)
    if car.speed < LEAST_MPS and not changes:
        return
    look_m = LATEST_M + (EARLIEST_M - LATEST_M) * car.style.politeness
    urgent = changes != 0 and left_m < look_m * abs(changes)
    for index in road.network.side_lanes(car.lane_index):
        towards = (index[2] - car.lane_index[2]) * changes > 0
        if urgent and not towards:
            continue
        if not road.network.get_lane(index).is_reachable_from(car.position):
            continue
        if _away_from_route(car, index):
            continue
        hurry = 1.0 - left_m / (look_m * abs(changes)) if urgent else 0.0
        if _accepts(car, index, must=urgent, hurry=hurry):
            car.target_lane_index = index
            return


def _away_from_route(car: Any, index: LaneIndex) -> bool:
    """True where nobody on this route can go on: the lane ends, or leads elsewhere, within reach."""
    if car.needs is None:
        return False
    changes, beyond = car.needs.get(index, (0, 0.0))
    here = car.needs.get(car.lane_index, (0, 0.0))[0]
    left_m = beyond + car.road.graph.length_m[index] - car.road.place(car, index)[0]
    return abs(changes) > abs(here) and left_m < EARLIEST_M


def _give_way(car: Any) -> None:
    """highway-env's: who changes into a lane that somebody close ahead is changing into as well stays where it is."""
    for other in car.road.changing_onto(car.target_lane_index):
        if other is car or other.lane_index == car.target_lane_index:
            continue
        ahead = car.road.place(other, car.lane_index)[0] - car.road.place(car, car.lane_index)[0]
        if 0 < ahead < car.LENGTH + car.style.min_gap_m + car.speed * car.style.time_headway_s:
            car.target_lane_index = car.lane_index
            return


def _accepts(car: Any, index: LaneIndex, *, must: bool, hurry: float) -> bool:
    """Is the gap on that lane good enough and, by choice, the lane better by more than the driver's threshold?"""
    road, style = car.road, car.style
    front, front_gap = road.ahead(car, index)
    rear, rear_gap = road.behind(car, index)
    lag_s = ACCEPTED_SHARE * style.gap_acceptance_s
    if rear is not None and rear_gap < style.min_gap_m / 2 + lag_s * (1.0 - 0.5 * hurry) * rear.speed:
        return False
    if front is not None and front_gap < style.min_gap_m / 2 + lag_s * 0.5 * car.speed:
        return False
    hardest = -MOBIL_SAFE_MPS2 * NEUTRAL_GAP_S / max(style.gap_acceptance_s, 1.0) * (1.0 + MUST_HARDER * hurry)
    if must:  # what it takes not to touch, rather than what is comfortable
        return min(_needed(rear, car, rear_gap), _needed(car, front, front_gap)) >= hardest
    rear_after = car.judged(rear, car, rear_gap) if rear is not None else 0.0
    own_after = car.judged(car, front, front_gap)
    if rear_after < hardest or own_after < hardest:
        return False
    before = road.ahead(car, car.lane_index)
    gain = own_after - car.judged(car, *before)
    if style.politeness > 0:
        gain += style.politeness * _others_gain(car, (front, front_gap), (rear, rear_gap), rear_after, before)
    if index[2] > car.lane_index[2]:  # to the right one goes because it is free, not for speed
        return bool(gain >= MOBIL_GAIN_MPS2 - KEEP_RIGHT_MPS2)
    return bool(gain >= MOBIL_GAIN_MPS2 / max(style.lane_change_eagerness, 1e-3) + KEEP_RIGHT_MPS2)


def _needed(car: Any, leader: Any, gap_m: float) -> float:
    """Acceleration that just brings a car to its leader's speed within the gap, m/s2; 0 or less."""
    if car is None or leader is None:
        return 0.0
    closing = max(car.speed - leader.speed, 0.0)
    return float(-(closing**2) / (2.0 * max(gap_m, LEAST_GAP_M)))


def _others_gain(
    car: Any, front: tuple[Any, float], rear: tuple[Any, float], rear_after: float, before: tuple[Any, float]
) -> float:
    """What the followers on both lanes gain together, m/s2; `before` is who is in front now. Gaps are in m."""
    gain = 0.0
    if rear[0] is not None:
        gain += rear_after - car.judged(rear[0], front[0], rear[1] + front[1] + car.LENGTH)
    behind, gap = car.road.behind(car, car.lane_index)
    if behind is not None:
        gain += car.judged(behind, before[0], gap + before[1] + car.LENGTH) - car.judged(behind, car, gap)
    return gain
