"""`StyledVehicle`: highway-env's IDM + MOBIL car whose driver is a `DriverStyle`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from highway_env.utils import not_zero, wrap_to_pi
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from stylesim.simulation.highway.following import cool
from stylesim.simulation.highway.noise import OrnsteinUhlenbeck
from stylesim.simulation.highway.path import braking_to_yield_mps2, curve_speed_mps, path_gap_m
from stylesim.style import DriverStyle

EMERGENCY_MPS2 = -4.5  # SUMO's default emergency threshold is its comfortable deceleration of 4.5 m/s2
TYRES_MPS2 = 8.0  # chosen, because dry asphalt gives about 0.8 g
TOP_SPEED_MPS = 60.0  # chosen, because highway-env's 40 m/s would cut off the wish of bold drivers
MOBIL_GAIN_MPS2 = 0.2  # highway-env's threshold, an average driver's
MOBIL_SAFE_MPS2 = 2.0  # highway-env's imposed braking, an average driver's
NEUTRAL_GAP_S = 4.5  # gap acceptance of the neutral driver in agents/styles.yaml
PEDAL_LAG = 0.3  # chosen: drivers anticipate, so only this part of the reaction time is left as a lag of the pedal
WANDER_SMOOTHING_S = 0.6  # chosen, because a car's lateral velocity has no jumps
HEADING_S, LATERAL_S = 0.3, 1.0  # chosen: highway-env's 0.2 and 0.6 overshoot when the wheels take time to turn
BEND_M = 0.5  # over which the curvature of the lane is taken
KERB_M = 0.2  # what wander leaves between the car's side and the lane's edge
CALM_MPS = 5.0  # below this speed wander and pedal noise fade: who stands does not stray
LANE_ANGLE_RAD = 0.35  # chosen: largest angle to the lane; highway-env's 45 degrees spins slow cars
WHEEL_RAD = 0.7  # chosen: lock of the front wheels; with highway-env's geometry a turning radius of 6.4 m
WHEEL_RAD_PS = 2.0  # chosen: how fast a driver turns them; without a limit the lateral velocity jumps


class StyledVehicle(IDMVehicle):  # type: ignore[misc]
    """IDM, MOBIL and steering with instance parameters, a lagged and restless pedal, and wander in the lane.

    `adopt` makes it somebody's; before, it drives as highway-env's own. Speeds never go below 0, the wished
    speed is the style's factor times the lane's limit (highway-env would clip it to the limit) and no more than
    the curve allows, and the gap of the IDM is bumper to bumper.
    """

    speed: float
    action: dict[str, float]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.driver_id = ""
        self.style: DriverStyle | None = None
        self.acceleration_mps2 = 0.0  # what the car does, after lag, noise and tyres
        self._foot_mps2 = 0.0
        self._wheel_rad = 0.0
        self.slip_rad = 0.0  # angle between its course and its body
        self.emergency_braked = False
        self.crashed_s = 0.0
        self.waits_for_gap = False  # set by the junction's right of way
        self._hesitation_s = 0.0
        self._was_yielding = False
        self._change_from_m = 0.0
        self._change_s = math.inf
        self._steered_lane = self.target_lane_index

    def adopt(
        self, style: DriverStyle, *, driver_id: str, pedal: np.random.Generator, lane: np.random.Generator
    ) -> None:
        """Make this the car of one driver: instance parameters instead of class constants."""
        self.style, self.driver_id = style, driver_id
        self.COMFORT_ACC_MAX = style.max_acceleration_mps2
        self.COMFORT_ACC_MIN = -style.comfortable_deceleration_mps2
        self.ACC_MAX, self.MAX_SPEED, self.DELTA = TYRES_MPS2, TOP_SPEED_MPS, 4.0
        self.MAX_STEERING_ANGLE = WHEEL_RAD
        self.KP_HEADING, self.TAU_PURSUIT, self.KP_LATERAL = 1 / HEADING_S, HEADING_S, 1 / LATERAL_S
        self.TIME_WANTED = style.time_headway_s
        self.DISTANCE_WANTED = style.min_gap_m + self.LENGTH
        self.POLITENESS = style.politeness
        self.LANE_CHANGE_MIN_ACC_GAIN = MOBIL_GAIN_MPS2 / max(style.lane_change_eagerness, 1e-3)
        self.LANE_CHANGE_MAX_BRAKING_IMPOSED = MOBIL_SAFE_MPS2 * NEUTRAL_GAP_S / max(style.gap_acceptance_s, 1.0)
        self._pedal = OrnsteinUhlenbeck(style.pedal_noise_mps2, style.pedal_noise_time_s, pedal)
        self._wander = OrnsteinUhlenbeck(
            style.lane_wander_m, style.lane_wander_time_s, lane, smoothing_s=WANDER_SMOOTHING_S
        )

    @property
    def wished_speed_mps(self) -> float:
        """What the driver would drive on a free road here; 0 while it yields or hesitates after yielding."""
        if self.waits_for_gap or getattr(self, "is_yielding", False) or self._hesitation_s > 0:
            return 0.0
        if self.style is None:
            return float(np.clip(self.target_speed, 0, self.lane.speed_limit))
        limit = self.style.desired_speed_factor * self.lane.speed_limit
        return min(limit, curve_speed_mps(self, self.style.comfortable_deceleration_mps2))

    def acceleration(self, ego_vehicle: Any, front_vehicle: Any = None, rear_vehicle: Any = None) -> float:
        """IDM acceleration of `ego_vehicle` as this driver would drive it, m/s2 (Treiber et al. 2000 [recalled])."""
        if not isinstance(ego_vehicle, Vehicle):
            return 0.0
        speed = max(ego_vehicle.speed, 0.0)
        wish = getattr(ego_vehicle, "wished_speed_mps", ego_vehicle.speed)
        ease, bold = -self.COMFORT_ACC_MIN, self.COMFORT_ACC_MAX
        if wish > 0.1:
            free = result = max(bold * (1.0 - (speed / wish) ** self.DELTA), -ease)
        else:
            free, result = 0.0, -braking_to_yield_mps2(ego_vehicle, ease)
        if front_vehicle is not None:
            bumpers = (ego_vehicle.LENGTH + front_vehicle.LENGTH) / 2
            gap = max(path_gap_m(ego_vehicle, front_vehicle) - bumpers, 0.1)
            wanted = max(self.desired_gap(ego_vehicle, front_vehicle) - self.LENGTH, self.DISTANCE_WANTED - self.LENGTH)
            idm = free - bold * (wanted / gap) ** 2
            result = min(result, cool(idm, ego_vehicle, front_vehicle, gap, bold=bold, ease=ease))
        return float(max(result, -self.ACC_MAX))

    def steering_control(self, target_lane_index: Any) -> float:
        """highway-env's cascade of lateral speed, heading and slip, towards a moving place in the lane, rad."""
        lane = self.road.network.get_lane(target_lane_index)
        along, lateral = lane.local_coordinates(self.position)
        if target_lane_index != self._steered_lane:
            if target_lane_index[:2] == self._steered_lane[:2]:  # a lane change, not the next road
                self._change_from_m, self._change_s = lateral, 0.0
            self._steered_lane = target_lane_index
        place, rate = self._place_in_lane(float(lane.width_at(along)))
        speed = not_zero(self.speed)
        command = (rate + self.KP_LATERAL * (place - lateral)) / speed
        reach = math.sin(LANE_ANGLE_RAD)
        bend = wrap_to_pi(lane.heading_at(along + BEND_M) - lane.heading_at(along)) / BEND_M
        slip_in_bend = math.asin(min(max(self.LENGTH / 2 * bend, -0.5), 0.5))
        ahead = lane.heading_at(along + self.speed * self.TAU_PURSUIT) - slip_in_bend
        turn = self.KP_HEADING * wrap_to_pi(ahead + math.asin(min(max(command, -reach), reach)) - self.heading)
        slip = math.asin(min(max(self.LENGTH / 2 / speed * turn, -1.0), 1.0))
        steering = math.atan(2 * math.tan(slip))
        return min(max(steering, -self.MAX_STEERING_ANGLE), self.MAX_STEERING_ANGLE)

    def _place_in_lane(self, width_m: float) -> tuple[float, float]:
        """Wished lateral place (m, right of the centre) and its rate (m/s): wander, and the change under way."""
        if self.style is None:
            return 0.0, 0.0
        fade = min(max(self.speed, 0.0) / CALM_MPS, 1.0)
        room = max((width_m - self.WIDTH) / 2 - KERB_M, 0.0)
        place, rate = fade * self._wander.value, fade * self._wander.rate
        if abs(place) > room:
            place, rate = math.copysign(room, place), 0.0
        duration = self.style.lane_change_duration_s
        if self._change_s < duration:
            phase = math.pi * self._change_s / duration
            place += self._change_from_m * (1 + math.cos(phase)) / 2
            rate -= self._change_from_m * math.pi / duration * math.sin(phase) / 2
        return place, rate

    def step(self, dt: float) -> None:
        """One step: pedal lag and noise, no reversing, then highway-env's bicycle model."""
        if self.style is not None and not self.crashed:
            self._drive(dt, self.style)
        before = self.speed
        super().step(dt)
        self.speed = max(self.speed, 0.0)
        self.acceleration_mps2 = (self.speed - before) / dt
        self.slip_rad = math.atan(math.tan(self.action["steering"]) / 2)
        self.crashed_s += dt if self.crashed else 0.0

    def _drive(self, dt: float, style: DriverStyle) -> None:
        yielding = self.waits_for_gap or bool(getattr(self, "is_yielding", False))
        if self._was_yielding and not yielding and self.speed < CALM_MPS:
            self._hesitation_s = style.reaction_time_s
        self._was_yielding = yielding
        self._hesitation_s = max(self._hesitation_s - dt, 0.0)
        self._change_s += dt
        self._wander.step(dt)
        lag = max(PEDAL_LAG * style.reaction_time_s, dt)
        self._foot_mps2 += (self.action["acceleration"] - self._foot_mps2) * dt / lag
        pressed = self._foot_mps2 + self._pedal.step(dt) * min(self.speed / CALM_MPS, 1.0)
        pressed = min(max(pressed, -TYRES_MPS2), TYRES_MPS2)
        self.emergency_braked |= pressed < EMERGENCY_MPS2
        turn = WHEEL_RAD_PS * dt
        self._wheel_rad += min(max(self.action["steering"] - self._wheel_rad, -turn), turn)
        self.action = {"steering": self._wheel_rad, "acceleration": max(pressed, -self.speed / dt)}

    def _is_colliding(self, other: Any, dt: float) -> Any:
        """highway-env's verdict (they touch, or will within dt), remembered by the road as a pair of ids."""
        touching, about_to, push = super()._is_colliding(other, dt)
        if touching or about_to:
            self.road.collided_pairs.add(frozenset((self.driver_id, getattr(other, "driver_id", ""))))
        return touching, about_to, push

    def predict_trajectory_constant_speed(self, times: np.ndarray) -> tuple[Sequence[np.ndarray], Sequence[float]]:
        """highway-env's prediction, computed once per state: the regulation asks for it once per pair."""
        key = (self.position.tobytes(), self.speed, self.lane_index, len(times))
        if getattr(self, "_predicted_for", None) != key:
            self._predicted = super().predict_trajectory_constant_speed(times)
            self._predicted_for = key
        return cast("tuple[Sequence[np.ndarray], Sequence[float]]", self._predicted)
