"""`stylesim/YellowLight-v0`: the ego approaches a traffic light that turns yellow before it, in SUMO."""

from __future__ import annotations

from typing import Any, ClassVar

from stylesim.envs.base import DrivingEnv
from stylesim.envs.sumo_client import SumoWorld
from stylesim.envs.world import World


class YellowLightEnv(DrivingEnv):
    """A signalised intersection; the light turns yellow when the ego is 1.5 to 6 s (drawn) from its stop line.

    The simulation runs in a child process of its own, so that several environments can live in one process.
    """

    backend: ClassVar[str] = "sumo"
    default_scenario: ClassVar[str] = "yellow_light"
    defaults: ClassVar[dict[str, Any]] = {"period_s": 0.1, "max_speed_mps": 25.0}

    def _make_world(self) -> World:
        return SumoWorld(self.config)
