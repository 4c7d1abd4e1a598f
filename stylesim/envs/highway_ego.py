"""The ego in highway-env: drives as commanded, holds its lane by the lateral controller of the other cars."""

from __future__ import annotations

from typing import Any

import numpy as np

from stylesim.envs.config import EnvConfig
from stylesim.envs.world import EgoCommand
from stylesim.simulation.highway.vehicle import StyledVehicle

COAST = EgoCommand(0.0, float("nan"), 0)
EGO_ID = "ego"


class EgoVehicle(StyledVehicle):
    """A car without a style of its own: its pedal is commanded, its lane is changed one at a time."""

    target_lane_index: tuple[str, str, int]
    squares: list[float]
    travelled_m: float
    steps: int
    reds_run: int

    def obey(self, config: EnvConfig, name: str = EGO_ID) -> None:
        """Become an ego: take a name, and the limits of the configuration."""
        self.driver_id = name
        self.ACC_MAX, self.MAX_SPEED = config.max_deceleration_mps2, config.max_speed_mps
        self._config = config
        self.command = COAST
        self.start_clock()

    def start_clock(self) -> None:
        """The next step is the first of the episode."""
        self.steps, self.squares, self.travelled_m, self.reds_run = 0, [0.0], 0.0, 0

    def begin_period(self, command: EgoCommand) -> None:
        """A new decision: aim at the next lane on the asked side, if there is one."""
        self.command = command
        self.squares, self.travelled_m, self.reds_run = [], 0.0, 0
        if command.lane_change and not self.crashed:
            start, end, lane = self.target_lane_index
            wanted = lane - command.lane_change  # highway-env counts lanes from the left
            if 0 <= wanted < len(self.road.network.graph[start][end]):
                self.target_lane_index = (start, end, wanted)

    def act(self, action: Any = None) -> None:
        """Pedal and wheel of the coming simulation step; called by the road."""
        if self.crashed:
            return
        self.follow_road()
        steering = self.steering_control(self.target_lane_index)
        self.action = {
            "acceleration": self.command.wished_acceleration(self.speed, self._config),
            "steering": float(np.clip(steering, -self.MAX_STEERING_ANGLE, self.MAX_STEERING_ANGLE)),
        }

    def step(self, dt: float) -> None:
        """One simulation step, added to what the decision period sums up."""
        super().step(dt)
        self.steps += 1
        self.squares.append(self.acceleration_mps2**2)
        self.travelled_m += self.speed * dt
