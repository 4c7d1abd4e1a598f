"""From an action to what the ego shall do: meta-actions as in highway-env, or acceleration and lane change."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from stylesim.envs.config import ActionType, EnvConfig
from stylesim.envs.world import EgoCommand
from stylesim.errors import InputError, unknown

META_ACTIONS = ("LANE_LEFT", "IDLE", "LANE_RIGHT", "FASTER", "SLOWER")  # the order of highway-env
LANE_CHANGE_THRESHOLD = 1.0 / 3.0  # chosen, because it gives left, stay and right equal thirds of the range


class ActionDecoder:
    """Turns actions into commands; remembers the target speed of the meta-actions."""

    def __init__(self, action_type: ActionType, config: EnvConfig) -> None:
        if action_type not in ("discrete", "continuous"):
            raise unknown("action type", str(action_type), ("discrete", "continuous"))
        self._discrete = action_type == "discrete"
        self._config = config
        self._target_mps = 0.0

    @property
    def space(self) -> gym.Space[Any]:
        """`Discrete(5)`, or a box of (acceleration, lane change) in [-1, 1]."""
        if self._discrete:
            return gym.spaces.Discrete(len(META_ACTIONS))
        return gym.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def reset(self, speed_mps: float) -> None:
        """A new episode: until told otherwise the ego keeps its speed."""
        self._target_mps = speed_mps

    def command(self, action: Any, speed_mps: float) -> EgoCommand:
        """The command of an action at this speed; InputError for an action outside the space."""
        return self._meta(action, speed_mps) if self._discrete else self._direct(action)

    def _meta(self, action: Any, speed_mps: float) -> EgoCommand:
        index = int(action)
        if not 0 <= index < len(META_ACTIONS):
            raise InputError(f"action {index} is none of 0 to {len(META_ACTIONS) - 1} ({', '.join(META_ACTIONS)})")
        name = META_ACTIONS[index]
        step = {"FASTER": 1, "SLOWER": -1}.get(name, 0)
        if step:  # from the speed that is driven, not from the last target: as highway-env's MDPVehicle
            level = np.floor(speed_mps / self._config.speed_step_mps + 0.5) + step
            self._target_mps = float(np.clip(level * self._config.speed_step_mps, 0.0, self._config.max_speed_mps))
        return EgoCommand(0.0, self._target_mps, {"LANE_LEFT": 1, "LANE_RIGHT": -1}.get(name, 0))

    def _direct(self, action: Any) -> EgoCommand:
        values = np.asarray(action, np.float64)
        if values.shape != (2,) or not np.isfinite(values).all():
            raise InputError(f"a continuous action is two finite numbers (acceleration, lane change), not {action!r}")
        pedal, wheel = np.clip(values, -1.0, 1.0)
        limit = self._config.max_acceleration_mps2 if pedal > 0 else self._config.max_deceleration_mps2
        lane_change = int(wheel > LANE_CHANGE_THRESHOLD) - int(wheel < -LANE_CHANGE_THRESHOLD)
        return EgoCommand(float(pedal * limit), float("nan"), lane_change)
