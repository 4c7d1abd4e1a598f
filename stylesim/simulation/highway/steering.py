"""How a driver steers: a moving place in the lane, and highway-env's cascade that brings the car there."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stylesim.style import DriverStyle

HEADING_S, LATERAL_S = 0.3, 1.0  # chosen: highway-env's 0.2 and 0.6 overshoot when the wheels take time to turn
BEND_M = 0.5  # over which the curvature of the lane is taken
LANE_ANGLE_RAD = 0.35  # chosen: largest angle to the lane; highway-env's 45 degrees spins slow cars
WHEEL_RAD = 0.7  # chosen: lock of the front wheels; with highway-env's geometry a turning radius of 6.4 m
WHEEL_RAD_PS = 2.0  # chosen: how fast a driver turns them; without a limit the lateral velocity jumps
LATERAL_MPS2 = 3.8  # chosen, because 4 m/s2 is what people accept at most, and discretisation adds a little
LEAST_LATERAL_MPS2 = 1.0  # chosen: whatever the pedal does, so much is left to steer with
BEND_MARGIN = 1.1  # chosen: over what the bend itself takes, so that the car can come back to the centre
SLOW_MPS = 0.01  # as highway-env's not_zero


def wrapped(angle_rad: float) -> float:
    """The angle in [-pi, pi), rad."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def steering_rad(car: Any, lane: Any, *, place_m: float, rate_mps: float, along_m: float, aside_m: float) -> float:
    """Wheel angle that brings a car to `place_m` right of the lane's centre, moving there with `rate_mps`, rad.

    highway-env's cascade of lateral speed, heading and slip, with the slip that the bend ahead asks for; bounded by
    the lock of the wheels and by the lateral acceleration that people accept.
    """
    speed = car.speed if abs(car.speed) > SLOW_MPS else SLOW_MPS
    command = (rate_mps + (place_m - aside_m) / LATERAL_S) / speed
    reach = math.sin(LANE_ANGLE_RAD)
    bend = wrapped(lane.heading_at(along_m + BEND_M) - lane.heading_at(along_m)) / BEND_M
    slip_in_bend = math.asin(min(max(car.LENGTH / 2 * bend, -0.5), 0.5))
    ahead = lane.heading_at(along_m + car.speed * HEADING_S) - slip_in_bend
    turn = wrapped(ahead + math.asin(min(max(command, -reach), reach)) - car.heading) / HEADING_S
    car.lateral_mps2 = max(LATERAL_MPS2, BEND_MARGIN * abs(bend) * speed**2)  # who entered a bend too fast holds on
    largest = car.lateral_mps2 / max(speed, 1.0)
    turn = min(max(turn, -largest), largest)
    slip = math.asin(min(max(car.LENGTH / 2 / speed * turn, -1.0), 1.0))
    steering = math.atan(2 * math.tan(slip))
    return min(max(steering, -WHEEL_RAD), WHEEL_RAD)


def turned_wheel_rad(wheel_rad: float, wish_rad: float, car: Any, dt: float) -> float:
    """The wheel angle after dt: as wished, as fast as a driver turns, without more lateral acceleration than accepted.

    In the bicycle model the course turns with the body, v sin(b) / (L / 2), and with the slip b itself, db/dt; both
    together times the speed are the acceleration across the course. Across the body, where people sit, what the pedal
    does adds a sin(b) at most; the rest of what is accepted bounds the new slip.
    """
    most = WHEEL_RAD_PS * dt
    wheel = wheel_rad + min(max(wish_rad - wheel_rad, -most), most)
    speed = max(car.speed, 1.0)
    before, wanted = math.atan(math.tan(wheel_rad) / 2), math.atan(math.tan(wheel) / 2)
    kept, weight = speed * before / dt, speed * speed / (car.LENGTH / 2) + speed / dt
    accepted = max(car.lateral_mps2 - abs(car.acceleration_mps2 * math.sin(before)), LEAST_LATERAL_MPS2)
    slip = min(max(wanted, (kept - accepted) / weight), (kept + accepted) / weight)
    return wheel if slip == wanted else math.atan(2 * math.tan(slip))


class LaneKeeping:
    """Where in its lane a driver wants to be: its wander, and the lane change under way."""

    def __init__(self, wander: Any, change_s: float) -> None:
        self._wander, self._change_s = wander, change_s
        self._next_change_s = change_s
        self._hurried_s = math.inf
        self._from_m, self._since_s = 0.0, math.inf

    def hurry(self, change_s: float) -> None:
        """The next change takes that long, whatever the style's."""
        self._hurried_s = change_s

    def begin_change(self, from_m: float) -> None:
        """A change begins at that place of the new lane (m, right of its centre)."""
        self._from_m, self._since_s = from_m, 0.0
        self._change_s = min(self._next_change_s, self._hurried_s)
        self._hurried_s = math.inf

    def retune(self, style: DriverStyle, rng: np.random.Generator | None = None) -> None:
        """Another person from here on; a lane change under way is finished as it was begun."""
        self._wander.retune(style, rng)
        self._next_change_s = style.lane_change_duration_s

    def step(self, dt: float, speed_mps: float) -> None:
        """Time passes."""
        self._since_s += dt
        self._wander.step(dt, speed_mps)

    def place(self) -> tuple[float, float]:
        """Wished place (m right of the centre) and rate (m/s) once the wheel has turned; a change is a half cosine."""
        place = self._wander.value + HEADING_S * self._wander.rate
        rate = self._wander.rate + HEADING_S * self._wander.pull
        if self._since_s < self._change_s:
            phase = math.pi * self._since_s / self._change_s
            place += self._from_m * (1 + math.cos(phase)) / 2
            rate -= self._from_m * math.pi / self._change_s * math.sin(phase) / 2
        return place, rate
