"""How a driver brakes to a stop line: evenly, with bounded jerk, as late as it likes to. Knows no simulator."""

from __future__ import annotations

import math
from dataclasses import dataclass

JERK_MPS3 = 12.0  # of braking that begins; chosen, because human limits end at 15
HARD_JERK_MPS3 = 30.0  # of a stop beyond 4.5 m/s2; chosen, because a panic stop builds up in about 0.3 s
HARD_MPS2 = 4.5  # the human limit outside emergencies
EMERGENCY_MPS2 = 8.0  # the human limit in an emergency
END_JERK_MPS3 = 10.0  # of the last moment; chosen, because a car that stands without a jolt eases the pedal
EASY_SHARE = 0.75  # a stop softer than this share of the wished deceleration is put off; chosen, because 2.2 m/s2
# at 5.6 s before the line (TRID 801675) must come out at 14 and at 20 m/s, for who wishes 2.8
GAP_M = 1.0  # to the stop line in the end; chosen, because people stand 1 to 2 m before it
LEAST_GAP_M = 0.3  # of who must brake hard; chosen, because it still stands before the line
REACHED_M = 0.2  # so near its place who creeps stops, too
STANDING_MPS = 0.05


def lost_m(speed_mps: float, deceleration_mps2: float) -> float:
    """What building up and easing off add to the way of even braking: v T / 2 and b^3 / (6 J^2) [ours]."""
    jerk = HARD_JERK_MPS3 if deceleration_mps2 > HARD_MPS2 else JERK_MPS3
    return speed_mps * deceleration_mps2 / (2.0 * jerk) + deceleration_mps2**3 / (6.0 * END_JERK_MPS3**2)


def latest_response_s(*, speed_mps: float, distance_m: float, deceleration_mps2: float) -> float:
    """How late one may begin to brake who stands before the line with at most that deceleration; < 0: too late."""
    way = speed_mps**2 / (2.0 * deceleration_mps2) + lost_m(speed_mps, deceleration_mps2) + LEAST_GAP_M
    return (distance_m - way) / speed_mps


@dataclass
class StopPlan:
    """The way to one stop: feed it the state of every step, it says the speed of the next one."""

    distance_m: float  # of the front bumper to the stop line
    response_s: float  # until then the driver goes on as before
    wish_mps2: float  # the deceleration that it wishes for
    hardest_mps2: float
    speed_mps: float  # at the moment
    braking: bool = False
    acceleration_mps2: float = 0.0
    _gap_m: float = GAP_M
    _jerk_mps3: float = JERK_MPS3

    def moved(self, speed_mps: float, dt_s: float) -> None:
        """A step has passed; whoever had a say in it, this was the speed of it."""
        self.distance_m -= speed_mps * dt_s
        self.response_s -= dt_s
        self.acceleration_mps2 = min((speed_mps - self.speed_mps) / dt_s, 0.0)
        self.speed_mps = speed_mps

    def next_speed(self, speed_mps: float, dt_s: float) -> float | None:
        """The speed to drive with in the next step; None until the response is over, then no faster than now.

        Even braking over what is left, v^2 / 2d, is approached by the jerk limit; in the end the braking falls with
        the square root of the speed, which keeps the jerk at `END_JERK_MPS3`.
        """
        if not self.braking:
            if self.response_s > 0.5 * dt_s:
                return None
            if not self._begins(speed_mps):
                return speed_mps
        if speed_mps <= STANDING_MPS:
            return 0.0
        even = speed_mps**2 / (2.0 * max(self.distance_m - self._gap_m, 0.05))
        wanted = -min(even, math.sqrt(2.0 * END_JERK_MPS3 * speed_mps), self.hardest_mps2)
        change = self._jerk_mps3 * dt_s
        self.acceleration_mps2 = min(max(wanted, self.acceleration_mps2 - change), self.acceleration_mps2 + change, 0.0)
        return max(0.0, speed_mps + self.acceleration_mps2 * dt_s)

    def _begins(self, speed_mps: float) -> bool:
        """Once the stop needs as much braking as the driver likes, or its place is reached."""
        room = max(self.distance_m - GAP_M, 0.05)
        need = speed_mps**2 / (2.0 * room)
        need = speed_mps**2 / (2.0 * max(room - lost_m(speed_mps, min(need, self.hardest_mps2)), 0.05))
        if need < EASY_SHARE * self.wish_mps2 and self.distance_m > GAP_M + REACHED_M:
            return False
        self.braking = True
        if need > HARD_MPS2:
            self._jerk_mps3 = HARD_JERK_MPS3
            self._gap_m = LEAST_GAP_M + min(need, self.hardest_mps2) ** 3 / (6.0 * END_JERK_MPS3**2)
        return True
