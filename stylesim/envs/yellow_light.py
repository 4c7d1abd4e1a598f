"""`stylesim/YellowLight-v0`: the ego approaches a traffic light that turns yellow before it, in SUMO."""

from __future__ import annotations

from typing import Any, ClassVar

from stylesim.envs.catalogue import SumoEnv


class YellowLightEnv(SumoEnv):
    """A signalised intersection; the light turns yellow when the ego is 1.5 to 6 s (drawn) from its stop line."""

    default_scenario: ClassVar[str] = "yellow_light"
    defaults: ClassVar[dict[str, Any]] = {"period_s": 0.1, "max_speed_mps": 25.0, "entry": "yellow"}
