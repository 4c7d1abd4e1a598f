"""`StyledVehicle`: highway-env's IDM + MOBIL car whose driver is a `DriverStyle`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from stylesim.simulation.highway.following import behind_leader, free_road
from stylesim.simulation.highway.lane_choice import Needs, choose_lane, must_change
from stylesim.simulation.highway.noise import Wander
from stylesim.simulation.highway.overtaking import FALLS_BACK_MPS2
from stylesim.simulation.highway.path import braking_to_yield_mps2, curve_speed_mps
from stylesim.simulation.highway.pedal import TYRES_MPS2, Pedal
from stylesim.simulation.highway.steering import LATERAL_MPS2, WHEEL_RAD, LaneKeeping, steering_rad, turned_wheel_rad
from stylesim.style import DriverStyle

TOP_SPEED_MPS = 60.0  # chosen, because highway-env's 40 m/s would cut off the wish of bold drivers
UNKNOWN_LIMIT_MPS = 20.0  # highway-env's default, for lanes of users that have none
LANE_WIDTH_M = 4.0  # highway-env's; what wander may use of it depends on the car's width
OTHERS_HEADWAY_S = 1.5  # of others one expects what the neutral driver keeps, at most (agents/styles.yaml)
KERB_M = 0.2  # what wander leaves between the car's side and the lane's edge
PULLS_OUT_S = 0.4  # chosen: who pulls out is closer than it would follow, and not for long
LANE_END_M = 15.0  # chosen: who must stop at the end of its lane leaves that much to pull away


class StyledVehicle(IDMVehicle):  # type: ignore[misc]
    """IDM, MOBIL and steering with instance parameters, a lagged and restless pedal, and wander in the lane.

    `adopt` makes it somebody's; before, it drives as highway-env's own. Speeds never go below 0, the wished
    speed is the style's factor times the lane's limit (highway-env would clip it to the limit) and no more than
    the curve allows, and the gap of the IDM is bumper to bumper. It drives on a `StyledRoad`.
    """

    speed: float
    crashed: bool
    impact: Any
    target_lane_index: tuple[str, str, int]
    action: dict[str, float]
    lane_from_road = True  # its closest lane is found by the road, for all cars at once

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.driver_id = ""
        self.style: DriverStyle | None = None
        self.needs: Needs | None = None  # lane changes that its route asks for
        self.flow_ratio = 1.0  # what it makes of its wish in view of the traffic around
        self.acceleration_mps2 = 0.0  # what the car does, after lag, noise and tyres
        self.slip_rad = 0.0  # angle between its course and its body
        self.crashed_s = 0.0
        self.waits_for_gap = False  # set by the junction's right of way
        self.stop_mps2 = math.inf  # how it brakes for a light; set by the lights, infinite where it need not
        self.emergency_braked = False
        self.lateral_mps2 = LATERAL_MPS2  # accepted now
        self.event_mps2 = math.inf  # a stressor: it accelerates no more than that
        self.runs = False  # a stressor: it drives on whatever light and right of way say
        self.passing_mps = 0.0  # the speed that it wishes while it overtakes; 0 while it does not
        self.passes: StyledVehicle | None = None  # the last one that it means to pass
        self.falls_back = False  # it overtakes no more, but waits for room behind whom it wanted to pass
        self._wheel_rad = 0.0
        self._was_yielding = False
        self._hesitation_s = 0.0
        self._steered_lane = self.target_lane_index

    def adopt(
        self, style: DriverStyle, *, driver_id: str, pedal: np.random.Generator, lane: np.random.Generator
    ) -> None:
        """Make this the car of one driver: instance parameters instead of class constants."""
        self.style, self.driver_id = style, driver_id
        self.ACC_MAX, self.MAX_SPEED = TYRES_MPS2, TOP_SPEED_MPS
        self.MAX_STEERING_ANGLE = WHEEL_RAD
        self._pedal = Pedal(style, pedal)
        room = (LANE_WIDTH_M - self.WIDTH) / 2 - KERB_M
        self._keeping = LaneKeeping(Wander(style, room_m=room, rng=lane), style.lane_change_duration_s)

    def become(
        self,
        style: DriverStyle,
        pedal: np.random.Generator | None = None,
        lane: np.random.Generator | None = None,
    ) -> None:
        """Its driver becomes another one on the way; with `pedal` and `lane` its noise goes on from other draws."""
        self.style = style
        self._pedal.retune(style, pedal)
        self._keeping.retune(style, lane)

    @property
    def wished_speed_mps(self) -> float:
        """What the driver would drive on a free road here; 0 while it yields or hesitates after yielding."""
        if self.style is None:
            return float(min(max(self.target_speed, 0.0), self.lane.speed_limit))
        yields = self.waits_for_gap or self._hesitation_s > 0 or getattr(self, "is_yielding", False)
        if yields and not self.runs:
            return 0.0
        limit = max(self.free_wish_mps * self.flow_ratio, self.passing_mps)
        if not self.road.graph.winds:
            return limit
        return min(limit, curve_speed_mps(self, self.style.comfortable_deceleration_mps2))

    @property
    def free_wish_mps(self) -> float:
        """What the driver would drive here if nobody else was about."""
        factor = 1.0 if self.style is None else self.style.desired_speed_factor
        return float(factor * (self.lane.speed_limit or UNKNOWN_LIMIT_MPS))

    def stand_at(self, index: tuple[str, str, int], along_m: float) -> None:
        """Put the car onto the centre of a lane, along it."""
        lane = self.road.network.get_lane(index)
        self.position = np.array(lane.position(along_m, 0.0), np.float64)
        self.heading = float(lane.heading_at(along_m))
        self.lane_index, self.lane = index, lane
        self.target_lane_index = self._steered_lane = index

    def act(self, action: Any = None) -> None:
        """Lane, wheel and pedal of the coming step, as the style wants them."""
        if self.crashed:
            return
        if self.style is None:
            super().act(action)
            return
        self.follow_road()
        if self.enable_lane_change:
            choose_lane(self)
        passes = self.passing_mps > 0.0 and not self.falls_back
        acceleration = self.judged(self, *self.road.ahead(self, self.lane_index), pulls_out=passes)
        if self.falls_back:
            acceleration = min(acceleration, -FALLS_BACK_MPS2)
        if self.target_lane_index != self.lane_index:
            onto = self.judged(self, *self.road.ahead(self, self.target_lane_index))
            acceleration = min(acceleration, onto)
        end = self._lane_end_m()
        if end < math.inf:
            acceleration = min(acceleration, self._before_standing(end))
        acceleration = min(acceleration, self.event_mps2)
        self.action = {"steering": self.steering_control(self.target_lane_index), "acceleration": acceleration}

    def cut_in(self, index: tuple[str, str, int], duration_s: float) -> None:
        """A stressor: change onto that lane in that time, whoever is there."""
        self._keeping.hurry(duration_s)
        self.enable_lane_change = False
        self.target_lane_index = index

    def judged(self, car: Any, leader: Any, gap_m: float, *, pulls_out: bool = False) -> float:
        """IDM acceleration of `car` behind `leader` as this driver would drive it, with its own patience, m/s2.

        Who `pulls_out` to pass the leader follows it closely meanwhile.
        """
        style = cast(DriverStyle, self.style)
        bold, ease = style.max_acceleration_mps2, style.comfortable_deceleration_mps2
        speed = max(car.speed, 0.0)
        wish = getattr(car, "wished_speed_mps", car.speed)
        if wish > 0.1:
            free = free_road(speed, wish, bold=bold, ease=ease)
        else:
            free = -braking_to_yield_mps2(car, ease) if isinstance(car, Vehicle) else 0.0
        if leader is None:
            return free
        turned = math.cos(leader.heading - car.heading)  # less than 1 for a leader that crosses
        return max(
            behind_leader(
                free,
                speed,
                leader.speed * turned,
                getattr(leader, "acceleration_mps2", 0.0) * turned,
                gap_m,
                headway_s=PULLS_OUT_S
                if pulls_out
                else style.time_headway_s
                if car is self
                else min(style.time_headway_s, OTHERS_HEADWAY_S),
                standing_m=style.min_gap_m,
                bold=bold,
                ease=ease,
            ),
            -TYRES_MPS2,
        )

    def acceleration(self, ego_vehicle: Any, front_vehicle: Any = None, rear_vehicle: Any = None) -> float:
        """highway-env's question: what would this driver do in that car behind that leader? m/s2."""
        if not isinstance(ego_vehicle, Vehicle):
            return 0.0
        if self.style is None:
            return float(super().acceleration(ego_vehicle, front_vehicle, rear_vehicle))
        if front_vehicle is None:
            return self.judged(ego_vehicle, None, math.inf)
        bumpers = (ego_vehicle.LENGTH + front_vehicle.LENGTH) / 2
        return self.judged(ego_vehicle, front_vehicle, ego_vehicle.lane_distance_to(front_vehicle) - bumpers)

    def _lane_end_m(self) -> float:
        """To the end of a lane that does not go on, from the front bumper; infinite where it does."""
        changes, left = must_change(self)
        if not changes or self.road.graph.after[self.target_lane_index]:
            return math.inf
        return left - self.LENGTH / 2 - LANE_END_M

    def _before_standing(self, gap_m: float) -> float:
        style = cast(DriverStyle, self.style)
        bold, ease = style.max_acceleration_mps2, style.comfortable_deceleration_mps2
        speed = max(self.speed, 0.0)
        return max(
            behind_leader(bold, speed, 0.0, 0.0, gap_m, headway_s=0.0, standing_m=0.5, bold=bold, ease=ease),
            -TYRES_MPS2,
        )

    def follow_road(self) -> None:
        """At the end of its lane the next one of the route becomes the target, where there is one."""
        if self.style is None:
            super().follow_road()
            return
        index = self.target_lane_index
        along = self.road.place(self, index)[0]
        if along > self.road.graph.length_m[index] - self.LENGTH / 2:
            if self.route and self.route[0][:2] == index[:2] and len(self.route) > 1:
                self.route.pop(0)
            self.target_lane_index = self.road.graph.onward(index, self.route) or index

    def steering_control(self, target_lane_index: Any) -> float:
        """highway-env's cascade of lateral speed, heading and slip, towards a moving place in the lane, rad."""
        lane = self.road.network.get_lane(target_lane_index)
        along, aside = self.road.place(self, target_lane_index)
        place, rate = 0.0, 0.0
        if self.style is not None:
            if target_lane_index != self._steered_lane:
                if target_lane_index[:2] == self._steered_lane[:2]:  # a lane change, not the next road
                    self._keeping.begin_change(aside)
                self._steered_lane = target_lane_index
            place, rate = self._keeping.place()
        return steering_rad(self, lane, place_m=place, rate_mps=rate, along_m=along, aside_m=aside)

    def step(self, dt: float) -> None:
        """One step: pedal and wheel take their time, then highway-env's bicycle model; no reversing."""
        if self.style is not None and not self.crashed:
            self._drive(dt, self.style)
        before = self.speed
        self.timer += dt
        self.clip_actions()
        self.slip_rad = math.atan(math.tan(self.action["steering"]) / 2)
        course = self.heading + self.slip_rad
        self.position[0] += self.speed * math.cos(course) * dt
        self.position[1] += self.speed * math.sin(course) * dt
        if self.impact is not None:
            self.position += self.impact
            self.crashed = True
            self.impact = None
        self.heading += self.speed * math.sin(self.slip_rad) / (self.LENGTH / 2) * dt
        self.speed = max(self.speed + self.action["acceleration"] * dt, 0.0)
        if not self.road.in_step:
            self.on_state_update()
        self.acceleration_mps2 = (self.speed - before) / dt
        self.crashed_s += dt if self.crashed else 0.0

    def _drive(self, dt: float, style: DriverStyle) -> None:
        yielding = self.waits_for_gap or bool(getattr(self, "is_yielding", False))
        if self._was_yielding and not yielding and self.speed < 5.0:
            self._hesitation_s = style.reaction_time_s
        self._was_yielding = yielding
        self._hesitation_s = max(self._hesitation_s - dt, 0.0)
        self._keeping.step(dt, self.speed)
        stop_mps2 = math.inf if self.runs else self.stop_mps2
        pressed = self._pedal.press(self.action["acceleration"], self.speed, dt, stop_mps2=stop_mps2)
        self.emergency_braked |= self._pedal.emergency
        self._wheel_rad = turned_wheel_rad(self._wheel_rad, self.action["steering"], self, dt)
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
