"""What can be set about an environment: strict, with the defaults and why they are so."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field, model_validator

from stylesim.specs import Spec, parse

ActionType = Literal["discrete", "continuous"]


class RewardWeights(Spec):
    """Weights of the reward's terms. Rates are per second of driving, so they do not depend on the period.

    The numbers are chosen, because waiting out a long red (30 s, 3 units of progress) must cost less than running it,
    and a collision must cost more than a whole episode of progress (60 s, 6 units) can earn.
    """

    progress: float = Field(default=0.1, ge=0)  # per second at the speed limit
    comfort: float = Field(default=0.02, ge=0)  # per second at 3 m/s2
    collision: float = Field(default=10.0, ge=0)  # once
    red: float = Field(default=4.0, ge=0)  # each red light that is run


class CostWeights(Spec):
    """Weights of the safety cost, which is no part of the reward (for constrained learning)."""

    collision: float = Field(default=1.0, ge=0)
    red: float = Field(default=1.0, ge=0)
    closeness: float = Field(default=0.1, ge=0)  # per second at a time to collision of 0
    critical_ttc_s: float = Field(default=1.5, gt=0)  # below it closeness rises from 0 to 1; usual surrogate threshold


class EnvConfig(Spec):
    """Everything that `gym.make(id, config={...})` accepts; see docs/environments.md."""

    duration_s: float = Field(default=60.0, gt=0, le=3600)
    period_s: float = Field(default=0.1, ge=0.1, le=5.0)  # time between two decisions, a multiple of 0.1 s
    neighbours: int = Field(default=8, ge=1, le=64)
    perception_m: float = Field(default=100.0, gt=0, le=500)  # farther vehicles are not seen
    max_speed_mps: float = Field(default=40.0, gt=0, le=60)  # of the ego: what the discrete action can ask for
    max_acceleration_mps2: float = Field(default=3.0, gt=0, le=10)
    max_deceleration_mps2: float = Field(default=8.0, gt=0, le=12)  # dry asphalt holds about 8 m/s2
    speed_step_mps: float = Field(default=5.0, gt=0, le=20)  # of FASTER and SLOWER, as in highway-env
    speed_control_time_s: float = Field(default=1.2, gt=0, le=10)  # chosen: SLOWER brakes with 2 to 6 m/s2
    ends_on_red: bool = False  # does running a red light end the episode
    onset_tts_s: tuple[float, float] = (
        1.5,
        6.0,
    )  # to the stop line at the onset of yellow: the dilemma zone
    entry: Literal["traffic", "yellow"] = "traffic"  # takes over a driver on its way, or meets a yellow on its approach
    approach_s: float = Field(default=4.0, ge=1.0, le=20)  # time from the first observation to the onset of yellow
    reward: RewardWeights = RewardWeights()
    cost: CostWeights = CostWeights()

    @model_validator(mode="after")
    def _fits(self) -> EnvConfig:
        low, high = self.onset_tts_s
        if not 0 < low <= high <= 10:
            raise ValueError(f"onset_tts_s needs 0 < low <= high <= 10, not {self.onset_tts_s}")
        if abs(self.period_s / 0.1 - round(self.period_s / 0.1)) > 1e-6:
            raise ValueError(f"period_s must be a multiple of 0.1 s, not {self.period_s}")
        return self

    @property
    def control_steps(self) -> int:
        """Simulation steps of 0.1 s between two decisions."""
        return round(self.period_s / 0.1)


def configured(changes: Mapping[str, Any] | EnvConfig | None, *, where: str, **defaults: Any) -> EnvConfig:
    """The configuration with `changes` over `defaults`; InputError names the field and the nearest known key."""
    if isinstance(changes, EnvConfig):
        return changes
    return parse(EnvConfig, {**defaults, **dict(changes or {})}, where)
