"""Traffic lights for highway-env, which has none: what they show, and drivers who obey or do not.

Every driver within 250 m of the line decides once at the onset of each yellow (`driving.decide_at_yellow`, a stream of
its own per driver and yellow). Who stops brakes after its response with what it takes to stand before the line; who
goes drives on, at red for as long as its style runs red, and then stops if it still can. Who comes later obeys.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int8

from stylesim.signals import Signals, SignalState
from stylesim.simulation.driving import HARDEST_BRAKING_MPS2, YellowDecision, decide_at_yellow
from stylesim.simulation.highway.graph import LaneIndex
from stylesim.simulation.highway.pedal import JERK_MPS3
from stylesim.tracks import TrackFlag

HORIZON_M = 250.0  # who is farther away at the onset of yellow does not decide; as in the other simulator
STANDS_BEFORE_M = 1.5  # chosen: how far before the line the front bumper comes to rest
AT_LINE_M = 5.0  # the first in a queue stands this close
STANDING_MPS = 0.3
LIMIT_MPS2 = 8.0  # a stop that needs more is not made
EARLY_S = 0.1  # a step until the pedal moves
RED_GRACE_S = 0.1  # the front over the line that long after the onset of red, or later, has run it

Streams = Callable[[str, str], np.random.Generator]  # of a driver, for a purpose


@dataclass(frozen=True)
class Programme:
    """Green, yellow and red in turn, s; the episode begins `offset_s` after an onset of green."""

    green_s: float
    yellow_s: float
    red_s: float
    offset_s: float = 0.0

    @property
    def cycle_s(self) -> float:
        """One turn, s."""
        return self.green_s + self.yellow_s + self.red_s

    def state(self, time_s: float) -> SignalState:
        """What is shown at that time of the episode."""
        at = (time_s + self.offset_s + 1e-6) % self.cycle_s
        if at < self.green_s:
            return SignalState.GREEN
        return SignalState.YELLOW if at < self.green_s + self.yellow_s else SignalState.RED

    def onsets_of_yellow(self, until_s: float) -> list[float]:
        """Times of the changes to yellow in [0, until_s), s."""
        first = (self.green_s - self.offset_s) % self.cycle_s
        return [float(time) for time in np.arange(first, until_s, self.cycle_s)]


@dataclass
class _Answer:
    """What one driver does about the present yellow and red."""

    decision: YellowDecision
    onset_s: float
    given_up: bool = False


class Lights:
    """The lights of one line: shows the programme, and tells every car where it must stop."""

    def __init__(self, lanes: Iterable[LaneIndex], programme: Programme, streams: Streams) -> None:
        self.lanes = tuple(lanes)
        self.programme, self._streams = programme, streams
        self._answers: dict[str, _Answer] = {}
        self._times_decided: dict[str, int] = {}
        self._before: dict[str, float] = {}  # distance to the line in the step before
        self._red_since_s = math.inf
        self.shown = programme.state(0.0)
        self.log: list[int] = []
        self.flags: dict[str, TrackFlag] = {}
        self.not_executed = 0  # stops that would have needed too much braking

    def before_step(self, time_s: float, road: Any) -> None:
        """Show what is due at this time, let drivers decide, and set everybody's `stop_ahead_m`."""
        shown = self.programme.state(time_s)
        onset = shown == SignalState.YELLOW and self.shown != SignalState.YELLOW
        if shown == SignalState.RED and self.shown != SignalState.RED:
            self._red_since_s = time_s
        if shown == SignalState.GREEN:
            self._answers.clear()
        self.shown = shown
        for car in road.vehicles:
            index = car.target_lane_index
            distance = road.graph.length_m[index] - road.place(car, index)[0] - car.LENGTH / 2
            if index not in self.lanes:  # over the line, or on its way out
                distance = -1.0
            self._note(car, distance, time_s)
            if car.style is None:  # somebody else drives it
                continue
            if onset and 0 < distance <= HORIZON_M:
                self._decide(car, distance, time_s)
            car.stop_ahead_m = self._stop_ahead(car, distance, time_s) if distance > 0 else math.inf

    def _decide(self, car: Any, distance_m: float, time_s: float) -> None:
        number = self._times_decided.get(car.driver_id, 0)
        self._times_decided[car.driver_id] = number + 1
        rng = self._streams(car.driver_id, f"yellow {number}")
        decision = decide_at_yellow(car.style, speed_mps=car.speed, distance_m=distance_m, rng=rng)
        self._answers[car.driver_id] = _Answer(decision, time_s)
        self._flag(car, TrackFlag.DECIDED_STOP if decision.stop else TrackFlag.DECIDED_GO)

    def _stop_ahead(self, car: Any, distance_m: float, time_s: float) -> float:
        """Where the car has to stop now, m from its front; infinite where it drives on."""
        if self.shown == SignalState.GREEN:
            return math.inf
        answer = self._answers.get(car.driver_id)
        place = max(distance_m - STANDS_BEFORE_M, 0.0)
        if answer is None:  # came too late to decide: obeys where it can
            able = _needed_mps2(car, distance_m) <= HARDEST_BRAKING_MPS2
            return place if able or car.stop_ahead_m < math.inf else math.inf
        if answer.decision.stop:
            return self._stops(car, answer, distance_m, time_s)
        if self.shown == SignalState.YELLOW or time_s - self._red_since_s <= car.style.red_running_s:
            return math.inf
        able = _needed_mps2(car, distance_m) <= car.style.comfortable_deceleration_mps2
        return place if able or car.stop_ahead_m < math.inf else math.inf

    def _stops(self, car: Any, answer: _Answer, distance_m: float, time_s: float) -> float:
        """The answer of who decided to stop: after its response, counted to the middle of the brake's build-up."""
        place = max(distance_m - STANDS_BEFORE_M, 0.0)
        if car.stop_ahead_m < math.inf:
            return place
        needed = _needed_mps2(car, place)
        if answer.given_up or time_s - answer.onset_s < answer.decision.response_s - EARLY_S - needed / (
            2.0 * JERK_MPS3
        ):
            return math.inf
        if needed > LIMIT_MPS2:
            answer.given_up = True
            self.not_executed += 1
            return math.inf
        return place

    def _note(self, car: Any, distance_m: float, time_s: float) -> None:
        """Flags of what the car did since the step before."""
        before = self._before.get(car.driver_id, math.inf)
        self._before[car.driver_id] = distance_m
        if distance_m <= 0 < before < math.inf:
            if self.shown == SignalState.YELLOW:
                self._flag(car, TrackFlag.CROSSED_ON_YELLOW)
            elif self.shown == SignalState.RED and time_s - self._red_since_s >= RED_GRACE_S:
                self._flag(car, TrackFlag.RAN_RED)
        elif 0 < distance_m <= AT_LINE_M and car.speed < STANDING_MPS and self.shown != SignalState.GREEN:
            self._flag(car, TrackFlag.STOPPED_AT_LINE)

    def _flag(self, car: Any, flag: TrackFlag) -> None:
        self.flags[car.driver_id] = self.flags.get(car.driver_id, TrackFlag(0)) | flag

    def note_frame(self, time_s: float) -> None:
        """Log what is shown now."""
        self.log.append(int(self.programme.state(time_s)))

    def signals(self, lane_ids: Iterable[str]) -> Signals:
        """The log, one light per lane."""
        ids = tuple(lane_ids)
        shown: Int8[np.ndarray, " time"] = np.array(self.log, np.int8)
        lights = tuple(f"light:{name}" for name in ids)
        return Signals(lights, tuple((name,) for name in ids), np.tile(shown, (len(ids), 1)))


def _needed_mps2(car: Any, distance_m: float) -> float:
    """Deceleration that stops the car at the line from now on, m/s2."""
    return float(car.speed**2 / (2.0 * max(distance_m, 0.01)))
