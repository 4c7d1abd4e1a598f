"""The ego in SUMO: drives as commanded, and is told where it stands."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any

import numpy as np

from stylesim.envs.config import EnvConfig
from stylesim.envs.sumo_crowd import SumoCrowd
from stylesim.envs.world import EgoCommand, EgoState
from stylesim.geometry import wrap_angle
from stylesim.signals import SignalState
from stylesim.simulation.sumo.episode import DT_S
from stylesim.simulation.sumo.takeover import onward

STANDING_MPS = 0.05  # chosen: half a centimetre per step of 0.1 s is no motion
NEAR_M = 1.0  # chosen: SUMO's distances along a lane and what was driven may differ by that much


class SumoEgo:
    """Applies commands step by step and keeps what one decision period adds up to."""

    def __init__(self, name: str, crowd: SumoCrowd, config: EnvConfig, speed_mps: float) -> None:
        self.name = name
        self._crowd = crowd
        self._sumo = crowd.sumo
        self._config = config
        self._speed = speed_mps
        self._acceleration = 0.0
        self._squares: list[float] = []
        self._travelled = 0.0
        self._reds = 0
        self._steps = 0
        self._link: tuple[str, int] | None = None  # of the light ahead
        self._lane = ""
        self._stop_line_m = np.inf
        self._directions: dict[str, tuple[list[float], list[float]]] = {}
        self._last = EgoState()
        self.present = True
        self.removed = False

    def start_clock(self) -> None:
        """The next step is the first of the episode."""
        self._steps = 0

    def begin_period(self, command: EgoCommand) -> None:
        """A new decision: start adding up anew, and begin the lane change if there is a lane on that side."""
        self._squares, self._travelled, self._reds = [], 0.0, 0
        if command.lane_change and self.present:
            self._change_lane(command.lane_change)

    def _change_lane(self, side: int) -> None:
        index = self._sumo.vehicle.getLaneIndex(self.name) + side  # SUMO counts lanes from the right
        if 0 <= index < self._sumo.edge.getLaneNumber(self._sumo.vehicle.getRoadID(self.name)):
            self._sumo.vehicle.changeLane(self.name, index, 0.0)

    def before_step(self, command: EgoCommand) -> None:
        """Ask for the speed of the next step."""
        acceleration = command.wished_acceleration(self._speed, self._config)
        wish = min(max(self._speed + acceleration * DT_S, 0.0), self._config.max_speed_mps)
        if acceleration < 0 and wish < STANDING_MPS:
            wish = 0.0  # a controller that only nears its target never stands
        self._sumo.vehicle.setSpeed(self.name, wish)

    def after_step(self, *, arrived: bool) -> None:
        """Take in what the step did."""
        self._steps += 1
        if arrived:
            self.present = False
            self._travelled += self._speed * DT_S
            return
        speed = self._sumo.vehicle.getSpeed(self.name)
        self._acceleration = (speed - self._speed) / DT_S
        self._squares.append(self._acceleration**2)
        self._speed = speed
        self._travelled += speed * DT_S
        self._keep_way()
        self._watch_light()

    def _keep_way(self) -> None:
        """Go where the lane leads, also where the route that was taken over would have gone elsewhere."""
        vehicle = self._sumo.vehicle
        lane = vehicle.getLaneID(self.name)
        if lane == self._lane or not lane or lane.startswith(":"):
            return
        self._lane = lane
        route = tuple(vehicle.getRoute(self.name)[vehicle.getRouteIndex(self.name) :])
        way = onward(self._sumo, lane, route)
        if way is not None:
            vehicle.setRoute(self.name, list(way))

    def _watch_light(self) -> None:
        """Follow the light ahead; one that was ahead and is not any more has been passed."""
        coming = self._sumo.vehicle.getNextTLS(self.name)
        ahead = (coming[0][0], coming[0][1]) if coming else None
        if self._link is not None and (ahead is None or ahead[0] != self._link[0]) and self._was_near():
            self._reds += self._crowd.light(self._link)[0] is SignalState.RED
        self._link = ahead
        self._stop_line_m = float(coming[0][2]) if coming else np.inf

    def _was_near(self) -> bool:
        """Was the stop line within the last step; otherwise a lane change has led away from the light."""
        return self._stop_line_m <= self._speed * DT_S + NEAR_M

    def take_off(self) -> None:
        """Be removed from the road, and remember where it was."""
        if self.present and not self.removed:
            self.state(collided=False)
            self._sumo.vehicle.remove(self.name)
        self.removed = True

    def state(self, *, collided: bool) -> EgoState:
        """Where the ego stands now; after its arrival or removal, where it stood last."""
        sums = {
            "time_s": self._steps * DT_S,
            "speed_mps": self._speed,
            "acceleration_mps2": self._acceleration,
            "rms_acceleration_mps2": float(np.sqrt(np.mean(self._squares))) if self._squares else 0.0,
            "travelled_m": self._travelled,
            "collided": float(collided),
            "reds_run": float(self._reds),
            "arrived": float(not self.present),
        }
        if self.present and not self.removed:
            sums |= self._on_lane() | self._at_light()
        self._last = self._last._replace(**sums)
        return self._last

    def _on_lane(self) -> dict[str, float]:
        vehicle, lane = self._sumo.vehicle, self._sumo.vehicle.getLaneID(self.name)
        index = vehicle.getLaneIndex(self.name)
        heading = np.pi / 2 - np.radians(vehicle.getAngle(self.name))
        return {
            "lane_offset_m": vehicle.getLateralLanePosition(self.name),
            "lane_heading_rad": float(wrap_angle(np.array(heading - self._lane_direction(lane)))),
            "lane_width_m": self._sumo.lane.getWidth(lane),
            "speed_limit_mps": self._sumo.lane.getMaxSpeed(lane),
            "lanes_left": float(self._sumo.edge.getLaneNumber(vehicle.getRoadID(self.name)) - 1 - index),
            "lanes_right": float(index),
        }

    def _lane_direction(self, lane: str) -> float:
        if lane not in self._directions:
            self._directions[lane] = _directions(self._sumo, lane)
        starts, angles = self._directions[lane]
        return angles[max(bisect_right(starts, self._sumo.vehicle.getLanePosition(self.name)) - 1, 0)]

    def _at_light(self) -> dict[str, float]:
        state, since_s = (SignalState.UNKNOWN, 0.0) if self._link is None else self._crowd.light(self._link)
        return {"signal_state": float(state), "stop_line_m": self._stop_line_m, "since_onset_s": since_s}


def _directions(sumo: Any, lane: str) -> tuple[list[float], list[float]]:
    """Where each straight piece of a lane starts along it, and its angle."""
    shape = np.array(sumo.lane.getShape(lane))
    pieces = np.diff(shape, axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(pieces[:, 0], pieces[:, 1]))])
    along *= sumo.lane.getLength(lane) / along[-1]  # SUMO's length may differ from the drawn shape's
    return along[:-1].tolist(), np.arctan2(pieces[:, 1], pieces[:, 0]).tolist()
