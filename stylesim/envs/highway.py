"""`stylesim/Highway-v0`: the ego among styled drivers on a motorway, in highway-env."""

from __future__ import annotations

from typing import ClassVar

from stylesim.envs.catalogue import HighwayScenarioEnv


class HighwayEnv(HighwayScenarioEnv):
    """A straight motorway without end; drivers around the ego by the population.

    As in highway-env's `highway-v0` an episode takes 40 s, and its traffic lies about and ahead of the ego.
    """

    default_scenario: ClassVar[str] = "highway"
    frame_px: ClassVar[tuple[int, int]] = (900, 160)
    px_per_m: ClassVar[float] = 5.0
