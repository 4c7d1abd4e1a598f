"""Where and when egos enter a SUMO scenario: in a driver's stead, or on an approach before a yellow light."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from stylesim.envs.config import EnvConfig
from stylesim.errors import InputError, SimulationError
from stylesim.simulation.sumo.takeover import LENGTH_M, Place, choose_places, put, take_over

EGO = "ego"
TRIES = 24  # places that are looked at for each onset
ONSETS = 4  # onsets that are waited for before any gap is taken
HEADWAY_S = 1.2  # chosen: the time gap at which a place counts as free, near what drivers keep (0.96-1.92 s)
STANDSTILL_M = 4.0
TIGHT_M = 1.0  # what must be free before and behind an ego that is squeezed in
COMFORT_MPS2 = 2.0  # comfortable deceleration, REFERENCE section 5


@dataclass(frozen=True)
class Approach:
    """The lanes of one edge from which one may drive straight on through one light."""

    light: str
    link: int  # index of one of the straight movements in the light's state
    edge: str
    next_edge: str
    lanes: tuple[str, ...]


@dataclass(frozen=True)
class Gap:
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


def find_place(sumo: Any, approach: Approach, rng: np.random.Generator, config: EnvConfig) -> Gap:
    """The roomiest of some random places from which the onset comes at a drawn time to the stop line."""
    best: Gap | None = None
    for _ in range(TRIES):
        lane = approach.lanes[int(rng.integers(len(approach.lanes)))]
        tts_s = float(rng.uniform(*config.onset_tts_s))
        length, limit = sumo.lane.getLength(lane), sumo.lane.getMaxSpeed(lane)
        speed = min(limit, (length - LENGTH_M) / (config.approach_s + tts_s), config.max_speed_mps)
        position = length - speed * (config.approach_s + tts_s)
        place = Gap(lane, position, speed, _slack_m(sumo, lane, position, speed))
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


def ego_names(count: int) -> tuple[str, ...]:
    """The first is `ego`, and with several of them the others are `ego.1`, `ego.2`, …."""
    return (EGO, *(f"{EGO}.{number}" for number in range(1, count)))


def insert_egos(
    sumo: Any,
    advance: Callable[[float], None],
    drivers: Callable[[], Iterable[str]],
    *,
    names: tuple[str, ...],
    rng: np.random.Generator,
    config: EnvConfig,
) -> tuple[float, ...]:
    """Bring the egos into the traffic as `config.entry` says; their speeds in m/s.

    InputError where several egos shall meet the same yellow, SimulationError where there is no room or nobody to
    take over.
    """
    if config.entry == "yellow":
        if len(names) > 1:
            raise InputError("entry 'yellow' is for one ego; several take over drivers with entry 'traffic'")
        return (insert_ego(sumo, advance, rng=rng, config=config).speed_mps,)
    chosen = choose_places(sumo, drivers, advance, count=len(names), rng=rng)
    for place, name in zip(chosen, names, strict=True):
        take_over(sumo, place, name)
    return tuple(place.speed_mps for place in chosen)


def insert_ego(sumo: Any, advance: Callable[[float], None], *, rng: np.random.Generator, config: EnvConfig) -> Gap:
    """Run the crowd (`advance(until_s)`) until the ego can enter, and put it there.

    Where no place is free at the drawn approach at four onsets, the ego enters the widest gap of all approaches at
    the pace of who is ahead, and meets the yellow when it does. SimulationError if there is no such gap either.
    """
    options = approaches(sumo)
    approach = options[int(rng.integers(len(options)))]
    for _ in range(ONSETS):
        onset_s = next_onset_s(sumo, approach, sumo.simulation.getTime() + config.approach_s)
        advance(onset_s - config.approach_s)
        gap = find_place(sumo, approach, rng, config)
        if gap.slack_m >= 0:
            break
    else:
        approach, gap = max(
            ((option, widest_gap(sumo, lane)) for option in options for lane in option.lanes),
            key=lambda item: item[1].slack_m,
        )
    if gap.slack_m < 0:
        raise SimulationError("no approach has room for the ego: the demand is too high")
    way = (approach.edge, approach.next_edge)
    put(sumo, Place("", gap.lane, gap.position_m, gap.speed_mps, way, 0.0), EGO)
    return gap


def widest_gap(sumo: Any, lane: str) -> Gap:
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
    return Gap(lane, rears[best] - ahead_m, pace, ahead_m - TIGHT_M)
