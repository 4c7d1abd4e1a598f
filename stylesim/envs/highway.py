"""`stylesim/Highway-v0`: the ego among styled drivers on a motorway, in highway-env."""

from __future__ import annotations

from typing import Any, ClassVar

from stylesim.envs.base import DrivingEnv
from stylesim.envs.highway_world import HighwayWorld
from stylesim.envs.world import World


class HighwayEnv(DrivingEnv):
    """A straight motorway without end; drivers around the ego by the population, decisions once a second.

    As in highway-env's `highway-v0` an episode takes 40 s, and its traffic lies about and ahead of the ego.
    """

    backend: ClassVar[str] = "highway"
    default_scenario: ClassVar[str] = "highway"
    defaults: ClassVar[dict[str, Any]] = {"period_s": 1.0, "duration_s": 40.0, "max_speed_mps": 40.0}
    frame_px: ClassVar[tuple[int, int]] = (900, 160)
    px_per_m: ClassVar[float] = 5.0

    def _make_world(self) -> World:
        return HighwayWorld(self.config)
