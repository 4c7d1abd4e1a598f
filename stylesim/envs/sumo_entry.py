"""Where and when the ego enters a SUMO scenario: on an approach, so that a yellow light will confront it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from stylesim.envs.config import EnvConfig
from stylesim.errors import InputError, SimulationError

EGO = "ego"
ROUTE = "ego.route"
TRIES = 24  # places that are looked at for each onset
ONSETS = 4  # onsets that are waited for before any gap is taken
HEADWAY_S = 1.2  # chosen: the time gap at which a place counts as free, near what drivers keep (0.96-1.92 s)
STANDSTILL_M = 4.0
TIGHT_M = 1.0  # what must be free before and behind an ego that is squeezed in
COMFORT_MPS2 = 2.0  # comfortable deceleration, REFERENCE section 5
LENGTH_M, WIDTH_M = 5.0, 1.8  # a passenger car, SUMO's default


@dataclass(frozen=True)
class Approach:
    """The lanes of one edge from which one may drive straight on through one light."""

    light: str
    link: int  # index of one of the straight movements in the light's state
    edge: str
    next_edge: str
    lanes: tuple[str, ...]


@dataclass(frozen=True)
class Place:
    """A lane, the position of the front bumper on it, and how much room is left there (below 0: too narrow)."""

    lane: str
    position_m: float
    speed_mps: float
    slack_m: float


def approaches(sumo: Any) -> list[Approach]:
    """All signalised straight movements, one entry per approaching edge; InputError if there is none."""
    found: dict[str, Approach] = {}
    for light in sorted(sumo.trafficlight.getIDList()):
        for link, movements in enumerate(sumo.trafficlight.getControlledLinks(light)):
            for lane, next_lane, _ in movements:
                if not _is_straight(sumo, lane, next_lane):
                    continue
                edge, next_edge = sumo.lane.getEdgeID(lane), sumo.lane.getEdgeID(next_lane)
                known = found.get(edge, Approach(light, link, edge, next_edge, ()))
                lanes = tuple(sorted({*known.lanes, lane}))
                found[edge] = Approach(known.light, known.link, edge, known.next_edge, lanes)
    if not found:
        raise InputError("this scenario has no traffic light that an ego could drive straight through")
    return [found[edge] for edge in sorted(found)]


def _is_straight(sumo: Any, lane: str, next_lane: str) -> bool:
    return any(link[0] == next_lane and link[6] == "s" for link in sumo.lane.getLinks(lane))


def next_onset_s(sumo: Any, approach: Approach, earliest_s: float) -> float:
    """Time of the first change from green to yellow of this movement at or after `earliest_s`, by the program."""
    light = approach.light
    phases = _phases(sumo, light)
    index, at = sumo.trafficlight.getPhase(light), sumo.trafficlight.getNextSwitch(light)
    for _ in range(1000 * len(phases)):
        following = (index + 1) % len(phases)
        before, after = phases[index].state[approach.link], phases[following].state[approach.link]
        if before in "Gg" and after in "yY" and at >= earliest_s:
            return float(at)
        index, at = following, at + phases[following].duration
    raise InputError(f"the light {light!r} never shows yellow to {approach.edge!r}")


def _phases(sumo: Any, light: str) -> Any:
    running = sumo.trafficlight.getProgram(light)
    for logic in sumo.trafficlight.getAllProgramLogics(light):
        if logic.programID == running:
            return logic.phases
    raise SimulationError(f"SUMO does not know the running program {running!r} of the light {light!r}")


def find_place(sumo: Any, approach: Approach, rng: np.random.Generator, config: EnvConfig) -> Place:
    """The roomiest of some random places from which the onset comes at a drawn time to the stop line."""
    best: Place | None = None
    for _ in range(TRIES):
        lane = approach.lanes[int(rng.integers(len(approach.lanes)))]
        tts_s = float(rng.uniform(*config.onset_tts_s))
        length, limit = sumo.lane.getLength(lane), sumo.lane.getMaxSpeed(lane)
        speed = min(limit, (length - LENGTH_M) / (config.approach_s + tts_s), config.max_speed_mps)
        position = length - speed * (config.approach_s + tts_s)
        place = Place(lane, position, speed, _slack_m(sumo, lane, position, speed))
        if place.slack_m >= 0:
            return place
        if best is None or place.slack_m > best.slack_m:
            best = place
    assert best is not None
    return best


def _slack_m(sumo: Any, lane: str, position_m: float, speed_mps: float) -> float:
    """Least gap to the others on that lane (also those half in it), less what two drivers keep."""
    slack = np.inf
    for other in sumo.lane.getLastStepVehicleIDs(lane):
        front, speed = sumo.vehicle.getLanePosition(other), sumo.vehicle.getSpeed(other)
        if front >= position_m:
            gap = front - sumo.vehicle.getLength(other) - position_m
            room = STANDSTILL_M + HEADWAY_S * speed_mps + _braking_m(speed_mps, speed)
        else:
            gap = position_m - LENGTH_M - front
            room = STANDSTILL_M + HEADWAY_S * speed + _braking_m(speed, speed_mps)
        slack = min(slack, gap - room)
    return float(slack)


def _braking_m(behind_mps: float, ahead_mps: float) -> float:
    """Additional room for the one behind to slow down to the one ahead in comfort."""
    return max(behind_mps - ahead_mps, 0.0) ** 2 / (2 * COMFORT_MPS2)


def insert_ego(
    sumo: Any, advance: Callable[[float], None], *, rng: np.random.Generator, config: EnvConfig
) -> tuple[Approach, Place]:
    """Run the crowd (`advance(until_s)`) until the ego can enter, and put it there.

    Where no place is free at the drawn approach at four onsets, the ego enters the widest gap of all approaches at
    the pace of who is ahead, and meets the yellow when it does. SimulationError if there is no such gap either.
    """
    options = approaches(sumo)
    approach = options[int(rng.integers(len(options)))]
    for _ in range(ONSETS):
        onset_s = next_onset_s(sumo, approach, sumo.simulation.getTime() + config.approach_s)
        advance(onset_s - config.approach_s)
        place = find_place(sumo, approach, rng, config)
        if place.slack_m >= 0:
            break
    else:
        approach, place = max(
            ((option, widest_gap(sumo, lane)) for option in options for lane in option.lanes),
            key=lambda item: item[1].slack_m,
        )
    if place.slack_m < 0:
        raise SimulationError("no approach has room for the ego: the demand is too high")
    _put(sumo, approach, place)
    return approach, place


def widest_gap(sumo: Any, lane: str) -> Place:
    """The middle of the widest gap between two vehicles of a lane (or its ends), at a pace that can be braked."""
    vehicles = sorted(
        (sumo.vehicle.getLanePosition(name), sumo.vehicle.getLength(name), sumo.vehicle.getSpeed(name))
        for name in sumo.lane.getLastStepVehicleIDs(lane)
    )
    fronts = [0.0, *(front for front, _, _ in vehicles)]
    rears = [*(front - length for front, length, _ in vehicles), sumo.lane.getLength(lane)]
    paces = [*(speed for _, _, speed in vehicles), 0.0]
    widths = [rear - front for front, rear in zip(fronts, rears, strict=True)]
    best = int(np.argmax(widths))
    ahead_m = max((widths[best] - LENGTH_M) / 2, 0.0)
    pace = min(sumo.lane.getMaxSpeed(lane), float(np.sqrt(paces[best] ** 2 + 2 * COMFORT_MPS2 * ahead_m)))
    return Place(lane, rears[best] - ahead_m, pace, ahead_m - TIGHT_M)


def _put(sumo: Any, approach: Approach, place: Place) -> None:
    sumo.vehicletype.copy("DEFAULT_VEHTYPE", EGO)
    for name, value in (("Length", LENGTH_M), ("Width", WIDTH_M), ("MaxSpeed", 70.0)):
        getattr(sumo.vehicletype, f"set{name}")(EGO, value)
    sumo.route.add(ROUTE, [approach.edge, approach.next_edge])
    lane_index = place.lane.rsplit("_", 1)[1]
    sumo.vehicle.add(EGO, ROUTE, typeID=EGO, departLane=lane_index, departSpeed="0")
    sumo.vehicle.setSpeedMode(EGO, 32)  # no safe speed, no limits, no right of way, no red light: only commands
    sumo.vehicle.setLaneChangeMode(EGO, 0)  # changes lane when told to, never by itself, whoever is there
    sumo.vehicle.moveTo(EGO, place.lane, place.position_m)
    sumo.vehicle.setPreviousSpeed(EGO, place.speed_mps)
    sumo.vehicle.setSpeed(EGO, place.speed_mps)
