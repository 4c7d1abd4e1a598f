"""How hard a driver brakes for somebody on foot in its way, whatever the simulator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stylesim.simulation.driving import brake_response, needed_deceleration, wished_deceleration
from stylesim.style import DriverStyle

SIGHT_M = 150.0  # chosen: who is farther away has time enough
STOPS_BEFORE_M = 2.0  # chosen: the distance that people keep to somebody on foot
HARDEST_MPS2 = 8.0  # the limit of human emergency braking that is kept everywhere
JERK_MPS3 = 12.0  # how fast the braking builds up; people stay below 15
MARGIN = 1.15  # on what is needed, because the braking takes time to build up; chosen
AT_EASE = 0.5  # of the wished deceleration: what needs less than that does not need braking yet; chosen


@dataclass
class Yield:
    """One driver and one walker: nothing until its response, then the braking that it takes."""

    driver: str
    acts_at_s: float
    wish_mps2: float
    braking_mps2: float = 0.0
    has_begun: bool = False

    @classmethod
    def begin(cls, driver: str, style: DriverStyle, now_s: float, rng: np.random.Generator) -> Yield:
        """The driver sees the walker now; response and wish are drawn by its style (`driving`)."""
        return cls(driver, now_s + brake_response(style, rng), wished_deceleration(style, rng))

    def deceleration(self, now_s: float, *, speed_mps: float, gap_m: float, dt_s: float) -> float | None:
        """What it brakes with now, m/s2; None before its response.

        At least what stops it 2 m before the walker's way, at most 8 m/s2; where half of its wish would do it only
        takes the foot off. It builds up with 12 m/s3.
        """
        if now_s < self.acts_at_s:
            return None
        left = gap_m - STOPS_BEFORE_M
        needed = needed_deceleration(speed_mps=speed_mps, distance_m=max(left, 0.1), response_s=0.0)
        least = AT_EASE * self.wish_mps2
        self.has_begun |= needed >= least
        goal = min(HARDEST_MPS2, MARGIN * needed) if self.has_begun else 0.0
        most = JERK_MPS3 * dt_s
        self.braking_mps2 += min(max(goal - self.braking_mps2, -most), most)
        return self.braking_mps2
