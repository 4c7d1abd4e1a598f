"""Recorded traffic lights on a driver's way: decided once at each yellow, and carried out."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from stylesim.randomness import stream
from stylesim.road import Road
from stylesim.signals import Signals, SignalState
from stylesim.simulation.driving import YellowDecision, decide_at_yellow, needed_deceleration
from stylesim.simulation.rollout.drive import HARDEST_MPS2
from stylesim.simulation.rollout.path import Path
from stylesim.style import DriverStyle
from stylesim.tracks import TrackFlag

NOTHING = TrackFlag(0)
BUILD_UP_S = 0.5  # from the foot to the braking: lag and limited jerk; the response lasts until the car brakes
HORIZON_M = 250.0  # who is farther away at the onset of yellow does not decide


@dataclass
class StopLine:
    """One light on a path, and what the driver has decided about its present yellow."""

    s_m: float
    state: np.ndarray  # over all frames
    decision: YellowDecision | None = None
    since: int = -1  # frame of the onset


def stop_lines(path: Path, road: Road, signals: Signals | None) -> list[StopLine]:
    """The lights at the ends of the path's lanes, in order."""
    if signals is None:
        return []
    rows = {lane: row for row, lanes in enumerate(signals.lane_id) for lane in lanes}
    ends = [*(start for start, _ in path.lanes[1:]), path.length_m]
    return [
        StopLine(end, signals.state[rows[lane]])
        for (_, lane), end in zip(path.lanes, ends, strict=True)
        if lane in rows
    ]


@dataclass
class Lights:
    """The lights before one driver."""

    driver: str
    style: DriverStyle
    key: tuple[int, int]  # seed, episode
    dt_s: float
    ahead: list[StopLine]
    flags: TrackFlag = NOTHING
    _decided: int = field(default=0)

    def obstacle(self, frame: int, front_m: float, speed_mps: float) -> tuple[float, float]:
        """(distance to the line where it will stop, deceleration that it wishes there); infinite where it goes on."""
        while self.ahead and front_m > self.ahead[0].s_m + 0.5:
            passed = self.ahead.pop(0)
            shown = int(passed.state[min(frame, len(passed.state) - 1)])
            if shown == SignalState.RED:
                self.flags |= TrackFlag.RAN_RED
            elif shown == SignalState.YELLOW:
                self.flags |= TrackFlag.CROSSED_ON_YELLOW
        if not self.ahead or self.ahead[0].s_m - front_m > HORIZON_M:
            return math.inf, self.style.comfortable_deceleration_mps2
        line = self.ahead[0]
        return self._answer(line, int(line.state[frame]), frame, line.s_m - front_m, speed_mps)

    def _answer(self, line: StopLine, shown: int, frame: int, gap_m: float, speed_mps: float) -> tuple[float, float]:
        ease = self.style.comfortable_deceleration_mps2
        if shown not in (SignalState.YELLOW, SignalState.RED):
            line.decision = None
            return math.inf, ease
        if line.decision is None and shown == SignalState.YELLOW:
            rng = stream(*self.key, self.driver, f"yellow {self._decided}")
            self._decided += 1
            line.decision = decide_at_yellow(self.style, speed_mps=speed_mps, distance_m=max(gap_m, 0.0), rng=rng)
            line.since = frame
            self.flags |= TrackFlag.DECIDED_STOP if line.decision.stop else TrackFlag.DECIDED_GO
        if line.decision is None:  # red already when it came into sight
            able = needed_deceleration(speed_mps=speed_mps, distance_m=gap_m, response_s=0.0) < HARDEST_MPS2
            return (gap_m if able else math.inf), ease
        if line.decision.stop:
            acts = (frame - line.since) * self.dt_s >= line.decision.response_s - BUILD_UP_S
            return (gap_m if acts else math.inf), line.decision.deceleration_mps2
        red_s = self._red_s(line, frame)
        gives_up = red_s > self.style.red_running_s
        able = needed_deceleration(speed_mps=speed_mps, distance_m=gap_m, response_s=0.0) < HARDEST_MPS2
        return (gap_m if gives_up and able else math.inf), ease

    def _red_s(self, line: StopLine, frame: int) -> float:
        """How long the light has been red."""
        first = frame
        while first >= 0 and line.state[first] == SignalState.RED:
            first -= 1
        return (frame - first) * self.dt_s
