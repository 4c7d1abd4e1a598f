"""The drivers' feet of `simulation.foot`, advanced step by step instead of over a whole log."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.simulation.foot import Foot
from stylesim.simulation.sumo.along import PURPOSE, pressed
from stylesim.simulation.sumo.episode import DT_S, Episode
from stylesim.simulation.sumo.live_draws import Draws


class Feet:
    """How far everybody is ahead of where SUMO has it; the same limits and streams as in a recorded episode."""

    def __init__(self, files: Episode) -> None:
        self._foot = Foot([pressed(driver.style, files) for driver in files.drivers.values()], dt_s=DT_S)
        self._draws = Draws(files, PURPOSE)

    def advance(
        self, rows: Int64[np.ndarray, " vehicle"], model_mps: Float64[np.ndarray, " vehicle"]
    ) -> tuple[Float64[np.ndarray, " vehicle"], Float64[np.ndarray, " vehicle"]]:
        """One step of 0.1 s of these drivers: m ahead, and speeds in m/s."""
        return self._foot.advance(rows, model_mps, self._draws.next(rows))
