"""Makes stressors happen in SUMO: finds who fits at the moment, does what it takes step by step, says what happened.

A walker is no road user of SUMO: on each lane that it crosses the next driver brakes for it (`Yielding`), and whoever
is behind follows that driver by its car-following model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

from stylesim.simulation.crossing import barriers, length_m, meeting
from stylesim.simulation.stressors import Attempt, Event, Outcome, attempts
from stylesim.simulation.sumo.episode import DT_S, EpisodeFiles
from stylesim.simulation.sumo.stressor_acts import Braking, CuttingIn, RunningRed
from stylesim.simulation.sumo.surroundings import (
    Here,
    drivers_here,
    follower,
    leader_within,
    red_light_ahead_m,
    room_beside,
)
from stylesim.simulation.sumo.yielding import Yielding
from stylesim.simulation.walkers import Walker

SLOWEST_MPS = 5.0  # who is slower is in a queue, where nothing unusual happens
LEAST_AHEAD_S = 4.0  # to the end of the lane; chosen, so that the event is over before a junction or the log's end
RUNS_AHEAD_S = 0.5  # but who runs a red is near its line
FOLLOWS_S = (0.5, 3.0)  # time gap of the follower of who brakes hard
RUNS_FROM_M = (8.0, 60.0)  # how far before its red light a runner is chosen
STALLS_BEFORE_END_M = 80.0  # of its lane, at least; who stalls stands in the middle of a road


@runtime_checkable
class Act(Protocol):
    """Something that goes on for a while."""

    def step(self, now_s: float) -> bool:
        """Do what the step needs; False when it is over."""
        ...


def _nothing(_: str) -> None:
    """Nobody else commands it."""


class Stressing:
    """The stressors of one episode; call `before_step` ahead of every simulation step."""

    def __init__(self, sumo: Any, files: EpisodeFiles) -> None:
        self._sumo, self._files = sumo, files
        self.let_go: Callable[[str], None] = _nothing  # what else commands a driver stops doing so
        self._waiting = list(attempts(files.plan, seed=files.seed, episode=files.episode, duration_s=files.duration_s))
        self._acts: list[Act] = []
        self._busy: set[str] = set()
        self._events: list[Event] = []
        self._walkers: list[Walker] = []
        self._missed: list[Any] = []

    def before_step(self, step: int) -> None:
        """What begins, goes on and ends in this step."""
        if not self._waiting and not self._acts:
            return
        now_s = step * DT_S - self._files.warm_up_s
        for attempt in [attempt for attempt in self._waiting if now_s >= attempt.at_s - 1e-9]:
            if now_s > attempt.until_s:
                self._missed.append(attempt.kind)
                self._waiting.remove(attempt)
            elif self._begin(attempt, now_s):
                self._waiting.remove(attempt)
        self._acts = [act for act in self._acts if act.step(now_s)]

    @property
    def walkers(self) -> tuple[Walker, ...]:
        """Everybody who has set out so far."""
        return tuple(self._walkers)

    def outcome(self) -> Outcome:
        """What came of it."""
        missed = (*self._missed, *(attempt.kind for attempt in self._waiting))
        return Outcome(tuple(self._events), tuple(self._walkers), missed)

    def _begin(self, attempt: Attempt, now_s: float) -> bool:
        able = [here for here in drivers_here(self._sumo, self._files) if here.driver not in self._busy]
        ahead_s = RUNS_AHEAD_S if attempt.kind == "red_runner" else LEAST_AHEAD_S
        able = [here for here in able if SLOWEST_MPS <= here.speed_mps <= here.left_m / ahead_s]
        for number in attempt.rng.permutation(len(able)).tolist():
            act = getattr(self, f"_{attempt.kind}")(attempt, able[number], now_s)
            if act is not None:
                self._acts.append(act)
                return True
        return False

    def _note(self, attempt: Attempt, now_s: float, *, actor: str, victim: str) -> None:
        self._busy |= {actor, victim} - {""}
        numbers = {name: value for name, value in attempt.numbers.items() if name != "side"}
        self._events.append(Event(attempt.kind, now_s, actor, victim, numbers))

    def _hard_brake(self, attempt: Attempt, here: Here, now_s: float) -> Act | None:
        behind = follower(self._sumo, here)
        if behind is None or not FOLLOWS_S[0] <= behind[1] / max(here.speed_mps, 1.0) <= FOLLOWS_S[1]:
            return None
        self._note(attempt, now_s, actor=here.driver, victim=behind[0])
        to_mps = here.speed_mps * attempt.numbers["to_share"]
        return Braking(self._sumo, here, attempt.numbers["braking_mps2"], to_mps, attempt.numbers["hold_s"])

    def _stalled(self, attempt: Attempt, here: Here, now_s: float) -> Act | None:
        stops_m = here.speed_mps**2 / (2 * attempt.numbers["braking_mps2"])
        if here.left_m < stops_m + STALLS_BEFORE_END_M:
            return None
        behind = follower(self._sumo, here)
        self._note(attempt, now_s, actor=here.driver, victim=behind[0] if behind else "")
        return Braking(self._sumo, here, attempt.numbers["braking_mps2"], 0.0, attempt.numbers["hold_s"])

    def _cut_in(self, attempt: Attempt, here: Here, now_s: float) -> Act | None:
        found = room_beside(self._sumo, here, attempt.numbers["gap_s"])
        if found is None or found.victim in self._busy or found.victim not in self._files.drivers:
            return None
        self._note(attempt, now_s, actor=here.driver, victim=found.victim)
        return CuttingIn(self._sumo, here, found.lane_index, attempt.numbers["duration_s"], now_s)

    def _red_runner(self, attempt: Attempt, here: Here, now_s: float) -> Act | None:
        distance = red_light_ahead_m(self._sumo, here)
        if (
            distance is None
            or leader_within(self._sumo, here, distance)
            or not RUNS_FROM_M[0] <= distance <= RUNS_FROM_M[1]
        ):
            return None
        self._note(attempt, now_s, actor=here.driver, victim="")
        self.let_go(here.driver)
        return RunningRed(self._sumo, here, now_s)

    def _jaywalker(self, attempt: Attempt, here: Here, now_s: float) -> Act | None:
        name = f"{attempt.kind}-0"
        from_m = here.position_m / self._stretch(here.lane)
        met = meeting(
            attempt,
            self._files.network.road,
            here.lane,
            from_m=from_m,
            speed_mps=here.speed_mps,
            now_s=now_s,
            name=name,
        )
        if met is None:
            return None
        self._note(attempt, now_s, actor=name, victim=here.driver)
        self._walkers.append(met.walker)
        planned = [
            replace(barrier, along_m=barrier.along_m * self._stretch(barrier.lane_id)) for barrier in barriers(met)
        ]
        return Yielding(self._sumo, self._files, planned, name)

    _deer = _jaywalker

    def _stretch(self, lane_id: str) -> float:
        """SUMO's length of the lane over that of its centre line; they may differ."""
        return self._files.network.length_m[lane_id] / length_m(self._files.network.road.lane(lane_id))
