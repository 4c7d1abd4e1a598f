"""Traffic lights for highway-env, which has none: what they show, and drivers who obey or do not.

Every driver within 250 m of the line decides once at the onset of each yellow (`driving.decide_at_yellow`, a stream of
its own per driver and yellow). Who stops does it by `stopping.StopPlan`, as in the other simulator; who goes drives on,
and gives up at red if it would cross later than its style runs red and can still stop. Who comes later obeys.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int8

from stylesim.signals import Signals, SignalState
from stylesim.simulation.driving import HARDEST_BRAKING_MPS2, decide_at_yellow, wished_deceleration
from stylesim.simulation.highway.graph import LaneIndex
from stylesim.simulation.stopping import EMERGENCY_MPS2, HARD_MPS2, JERK_MPS3, StopPlan, latest_response_s
from stylesim.tracks import TrackFlag

HORIZON_M = 250.0  # who is farther away at the onset of yellow does not decide; as in the other simulator
AT_LINE_M = 5.0  # the first in a queue stands this close
STANDING_MPS = 0.3
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
    """What one driver does about the present yellow and red: stop by a plan, or go."""

    number: int  # of the driver's decisions
    plan: StopPlan | None


class Lights:
    """The lights of one line: shows the programme, and tells every car how to brake for it."""

    def __init__(self, lanes: Iterable[LaneIndex], programme: Programme, streams: Streams, *, dt_s: float) -> None:
        self.lanes = tuple(lanes)
        self.programme, self._streams, self._dt_s = programme, streams, dt_s
        self._answers: dict[str, _Answer] = {}
        self._times_decided: dict[str, int] = {}
        self._before: dict[str, float] = {}  # distance to the line in the step before
        self._red_since_s = math.inf
        self.shown = programme.state(0.0)
        self.log: list[int] = []
        self.flags: dict[str, TrackFlag] = {}
        self.not_executed = 0  # stops that would have needed too much braking
        self.gave_up = 0  # who decided to go, and stopped at red

    def before_step(self, time_s: float, road: Any) -> None:
        """Show what is due at this time, let drivers decide, and set everybody's `stop_mps2`."""
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
                self._decide(car, distance)
            car.stop_mps2 = self._braking(car, distance, time_s) if distance > 0 else math.inf

    def _decide(self, car: Any, distance_m: float) -> None:
        number = self._times_decided.get(car.driver_id, 0)
        self._times_decided[car.driver_id] = number + 1
        rng = self._streams(car.driver_id, f"yellow {number}")
        decision = decide_at_yellow(car.style, speed_mps=car.speed, distance_m=distance_m, rng=rng)
        self.not_executed += decision.impossible
        plan = None
        if decision.stop:
            response, wish = decision.response_s + self._dt_s, decision.deceleration_mps2  # this step counts it down
            plan = StopPlan(distance_m, response, wish, EMERGENCY_MPS2, speed_mps=car.speed)
        self._answers[car.driver_id] = _Answer(number, plan)
        self._flag(car, TrackFlag.DECIDED_STOP if decision.stop else TrackFlag.DECIDED_GO)

    def _braking(self, car: Any, distance_m: float, time_s: float) -> float:
        """The acceleration that the light asks for now, m/s2; infinite where the car drives as it likes."""
        if self.shown == SignalState.GREEN:
            return math.inf
        answer = self._answers.get(car.driver_id)
        if answer is None:  # came too late to decide: obeys where it can
            able = _can_stop(car, distance_m, HARDEST_BRAKING_MPS2)
            wish = car.style.comfortable_deceleration_mps2
            plan = StopPlan(distance_m, 0.0, wish, EMERGENCY_MPS2, speed_mps=car.speed) if able else None
            answer = self._answers[car.driver_id] = _Answer(-1, plan)
        if answer.plan is None and answer.number >= 0 and self.shown == SignalState.RED:
            self._think_again(car, answer, distance_m, time_s)
        if answer.plan is None:
            return math.inf
        answer.plan.moved(car.speed, self._dt_s)
        answer.plan.distance_m, answer.plan.acceleration_mps2 = distance_m, car.acceleration_mps2
        speed = answer.plan.next_speed(car.speed, self._dt_s)
        if speed is None:
            return math.inf
        if not answer.plan.braking:  # no faster than now, as soon as the foot is off the pedal
            return max(0.0, float(car.acceleration_mps2) - JERK_MPS3 * self._dt_s)
        return (speed - car.speed) / self._dt_s

    def _think_again(self, car: Any, answer: _Answer, distance_m: float, time_s: float) -> None:
        """Who decided to go stops at red after all, if it would cross later than it runs red, and can."""
        left_s = car.style.red_running_s - (time_s - self._red_since_s)
        if distance_m <= car.speed * max(left_s, 0.0) or not _can_stop(car, distance_m, HARD_MPS2):
            return
        wish = wished_deceleration(car.style, self._streams(car.driver_id, f"gives up {answer.number}"))
        answer.plan = StopPlan(distance_m, 0.0, wish, EMERGENCY_MPS2, speed_mps=car.speed)
        self.gave_up += 1

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


def _can_stop(car: Any, distance_m: float, deceleration_mps2: float) -> bool:
    """Whether the car can stand before the line, braking from now on with no more than that."""
    if car.speed < STANDING_MPS:
        return True
    late = latest_response_s(speed_mps=car.speed, distance_m=distance_m, deceleration_mps2=deceleration_mps2)
    return late >= 0.0
