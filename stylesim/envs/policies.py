"""Three simple egos to hold a learned one against: idle, random, and one that follows and stops by the IDM."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from jaxtyping import Float32

from stylesim.envs.action import META_ACTIONS
from stylesim.envs.base import DrivingEnv
from stylesim.envs.observation import (
    LENGTH_SCALE_M,
    ROAD_COLUMNS,
    SIGNAL_COLUMNS,
    SPEED_SCALE_MPS,
    VEHICLE_COLUMNS,
    WIDTH_SCALE_M,
    Layout,
)
from stylesim.errors import unknown
from stylesim.signals import SignalState
from stylesim.style import DriverStyle
from stylesim.styles import style_table

Policy = Callable[[Float32[np.ndarray, " value"]], Any]
POLICIES = ("idle", "random", "idm")
DEAD_BAND_MPS2 = 0.3  # the IDM ego's wish is this small: IDLE
CORRIDOR_MARGIN_M = 0.3


def policy(name: str, env: gym.Env[Any, Any]) -> Policy:
    """The policy of that name for an environment of this package; InputError for an unknown name."""
    if name == "idle":
        still = 1 if isinstance(env.action_space, gym.spaces.Discrete) else np.zeros(2, np.float32)
        return lambda observation: still
    if name == "random":
        return lambda observation: env.action_space.sample()
    if name == "idm":
        base = env.unwrapped
        assert isinstance(base, DrivingEnv)
        return IdmEgo(base)
    raise unknown("policy", name, POLICIES)


class IdmEgo:
    """The neutral driver of `agents/styles.yaml` as an Intelligent Driver Model (Treiber et al. 2000 [recalled]).

    It sees nothing but the observation. The stop line is a standing leader while the light is red, or yellow and the
    comfortable deceleration suffices to stop; it keeps its lane.
    """

    def __init__(self, env: DrivingEnv) -> None:
        self._layout: Layout = env.layout
        self._config = env.config
        self._discrete = isinstance(env.action_space, gym.spaces.Discrete)
        self._style: DriverStyle = style_table().at(0.0)

    def __call__(self, observation: Float32[np.ndarray, " value"]) -> Any:
        """The action for an observation."""
        wish = self.acceleration(observation)
        if self._discrete:
            name = "FASTER" if wish > DEAD_BAND_MPS2 else "SLOWER" if wish < -DEAD_BAND_MPS2 else "IDLE"
            return META_ACTIONS.index(name)
        limit = self._config.max_acceleration_mps2 if wish > 0 else self._config.max_deceleration_mps2
        return np.array([np.clip(wish / limit, -1.0, 1.0), 0.0], np.float32)

    def acceleration(self, observation: Float32[np.ndarray, " value"]) -> float:
        """The wished acceleration in m/s²."""
        style, road = self._style, dict(zip(ROAD_COLUMNS, self._layout.road(observation), strict=True))
        ego = self._layout.vehicles(observation)[0]
        speed = float(np.hypot(ego[3], ego[4])) * SPEED_SCALE_MPS
        wished = max(style.desired_speed_factor * float(road["speed_limit"]) * SPEED_SCALE_MPS, 0.1)
        free = 1.0 - (speed / wished) ** 4
        hindrances = [*self._leaders(observation), *self._stop_line(observation, speed)]
        gaps = [self._interaction(speed, gap, closing) for gap, closing in hindrances]
        return style.max_acceleration_mps2 * (free - max(gaps, default=0.0))

    def _interaction(self, speed: float, gap_m: float, closing_mps: float) -> float:
        style = self._style
        comfort = 2.0 * np.sqrt(style.max_acceleration_mps2 * style.comfortable_deceleration_mps2)
        wanted = style.min_gap_m + max(0.0, speed * style.time_headway_s + speed * closing_mps / comfort)
        return float((wanted / max(gap_m, 0.1)) ** 2)

    def _leaders(self, observation: Float32[np.ndarray, " value"]) -> list[tuple[float, float]]:
        """Gap and closing speed of those whose box reaches into the ego's straight corridor ahead."""
        table = self._layout.vehicles(observation)
        column = {name: table[:, i] for i, name in enumerate(VEHICLE_COLUMNS)}
        length, width = column["length"] * LENGTH_SCALE_M, column["width"] * WIDTH_SCALE_M
        x, y = column["x"] * self._layout.perception_m, column["y"] * self._layout.perception_m
        aside = (width * np.abs(column["cos_h"]) + length * np.abs(column["sin_h"]) + width[0]) / 2 + CORRIDOR_MARGIN_M
        gap = x - (length + length[0]) / 2
        here = (column["presence"] > 0) & (x > 0) & (np.abs(y) < aside)
        here[0] = False
        return [(float(gap[i]), -float(column["vx"][i]) * SPEED_SCALE_MPS) for i in np.flatnonzero(here)]

    def _stop_line(self, observation: Float32[np.ndarray, " value"], speed: float) -> list[tuple[float, float]]:
        signal = dict(zip(SIGNAL_COLUMNS, self._layout.signal(observation), strict=True))
        distance = float(signal["stop_line"]) * self._layout.perception_m
        red = signal[f"signal_{SignalState.RED.name.lower()}"] > 0.5
        yellow = signal[f"signal_{SignalState.YELLOW.name.lower()}"] > 0.5
        can_stop = speed**2 / (2 * max(distance, 0.1)) <= self._style.comfortable_deceleration_mps2
        return [(distance, speed)] if red or (yellow and can_stop) else []
