"""The ego's body: a kinematic bicycle about the box centre, within the limits of an ordinary car."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from stylesim.planners.answers import EgoControl

LENGTH_M, WIDTH_M = 5.0, 1.8  # SUMO's passenger car, and nearly highway-env's (5 x 2)
MAX_ACCELERATION_MPS2 = 4.0  # chosen, because a passenger car reaches about 3.5 at low speed
MAX_BRAKING_MPS2 = 8.0  # dry asphalt holds about 0.8 g
MAX_LATERAL_MPS2 = 8.0  # and so it does sideways
MAX_STEERING_RAD = 0.7  # lock of the front wheels; chosen: with 5 m between the axles a radius of 6.4 m
STEERING_RAD_PS = 2.0  # chosen, because nobody turns the wheels faster
MAX_SPEED_MPS = 60.0


class EgoState(NamedTuple):
    """The ego at one moment: box centre in m, counter-clockwise heading, speed along the course, wheels."""

    x: float
    y: float
    heading_rad: float
    speed_mps: float
    steering_rad: float = 0.0

    @property
    def slip_rad(self) -> float:
        """Angle of the course to the body: atan(tan(steering) / 2), the centre lies midway between the axles."""
        return math.atan(math.tan(self.steering_rad) / 2.0)

    @property
    def velocity_mps(self) -> tuple[float, float]:
        """Of the box centre."""
        course = self.heading_rad + self.slip_rad
        return self.speed_mps * math.cos(course), self.speed_mps * math.sin(course)


@dataclass(frozen=True)
class Limited:
    """A control within the limits, and whether something was cut off."""

    control: EgoControl
    cut: bool


def limited(control: EgoControl, state: EgoState, *, dt_s: float) -> Limited:
    """What the car can do of a control in the coming `dt_s`: pedal, lock and speed of the wheels, and the tyres."""
    pedal = min(max(control.acceleration_mps2, -MAX_BRAKING_MPS2), MAX_ACCELERATION_MPS2)
    pedal = min(max(pedal, -state.speed_mps / dt_s), (MAX_SPEED_MPS - state.speed_mps) / dt_s)
    lock = min(MAX_STEERING_RAD, _tyre_lock(state.speed_mps))
    wish = min(max(control.steering_rad, -lock), lock)
    turn = STEERING_RAD_PS * dt_s
    wheel = min(max(wish, state.steering_rad - turn), state.steering_rad + turn)
    wheel = min(max(wheel, -lock), lock)
    standing = state.speed_mps + control.acceleration_mps2 * dt_s < 0  # braking on while it stands is no excess
    cut = wheel != control.steering_rad or (pedal != control.acceleration_mps2 and not standing)
    return Limited(EgoControl(pedal, wheel), cut)


def _tyre_lock(speed_mps: float) -> float:
    """Largest steering at which v^2 * curvature stays below the tyres' limit; curvature = 2 sin(slip) / length."""
    if speed_mps < 1.0:
        return MAX_STEERING_RAD
    slip = math.asin(min(1.0, MAX_LATERAL_MPS2 * LENGTH_M / (2.0 * speed_mps**2)))
    return math.atan(2.0 * math.tan(min(slip, 1.0)))


def moved(state: EgoState, control: EgoControl, *, dt_s: float) -> EgoState:
    """The state after `dt_s` of a control that is within the limits (Euler, as highway-env's vehicle)."""
    turned = state._replace(steering_rad=control.steering_rad)
    vx, vy = turned.velocity_mps
    rate = 2.0 * state.speed_mps * math.sin(turned.slip_rad) / LENGTH_M
    heading = math.remainder(state.heading_rad + rate * dt_s, 2.0 * math.pi)
    speed = min(max(state.speed_mps + control.acceleration_mps2 * dt_s, 0.0), MAX_SPEED_MPS)
    return EgoState(state.x + vx * dt_s, state.y + vy * dt_s, heading, speed, control.steering_rad)
