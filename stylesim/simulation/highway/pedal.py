"""The driver's foot: it lags, it is restless, and it does not jump."""

from __future__ import annotations

import math

import numpy as np

from stylesim.simulation.highway.noise import OrnsteinUhlenbeck
from stylesim.style import DriverStyle

COMFORT_MPS2 = 4.5  # what people brake with outside emergencies (SUMO's comfortable deceleration); more is an emergency
TYRES_MPS2 = 8.0  # chosen, because dry asphalt gives about 0.8 g
PEDAL_LAG = 0.3  # chosen: drivers anticipate, so only this part of the reaction time is left as a lag of the pedal
NOISE_SMOOTHING_S = 0.3  # chosen, because a foot has no jumps: the jerk of the noise stays finite
JERK_MPS3 = 12.0  # chosen: brakes build up 4 m/s2 in a third of a second; 15 m/s3 is the limit that is asked for
LAST_MPS2, EASE_PER_S = 0.8, 2.0  # chosen: people let the brake go before they stand, so that it does not jolt
CALM_MPS = 5.0  # below this speed the restlessness fades: who stands does not press


class Pedal:
    """From the wished acceleration to the one that is pressed."""

    def __init__(self, style: DriverStyle, rng: np.random.Generator) -> None:
        self._noise = OrnsteinUhlenbeck(
            style.pedal_noise_mps2, style.pedal_noise_time_s, rng, smoothing_s=NOISE_SMOOTHING_S
        )
        self._lag_s = PEDAL_LAG * style.reaction_time_s
        self._foot_mps2 = 0.0
        self._pressed_mps2 = 0.0
        self.emergency = False

    def retune(self, style: DriverStyle, rng: np.random.Generator | None = None) -> None:
        """The foot of another person from here on; with `rng` its restlessness goes on from other draws."""
        self._noise.retune(style.pedal_noise_mps2, style.pedal_noise_time_s, rng)
        self._lag_s = PEDAL_LAG * style.reaction_time_s

    def press(self, wish_mps2: float, speed_mps: float, dt: float, *, stop_mps2: float = math.inf) -> float:
        """The pressed acceleration dt seconds later, m/s2; sets `emergency` where the wish needs more than comfort.

        Restlessness alone never brakes harder than comfort. `stop_mps2` is that of a stop which has its response and
        its bounded jerk in itself (`stopping`): the foot presses no less.
        """
        self._foot_mps2 += (wish_mps2 - self._foot_mps2) * dt / max(self._lag_s, dt)
        noise = self._noise.step(dt) * min(max(speed_mps, 0.0) / CALM_MPS, 1.0)
        lowest = max(min(-COMFORT_MPS2, self._foot_mps2), -(LAST_MPS2 + EASE_PER_S * max(speed_mps, 0.0)))
        wanted = min(max(self._foot_mps2 + noise, lowest, -TYRES_MPS2), COMFORT_MPS2)
        most = JERK_MPS3 * dt
        self._pressed_mps2 += min(max(wanted - self._pressed_mps2, -most), most)
        self._pressed_mps2 = min(self._pressed_mps2, max(stop_mps2, -TYRES_MPS2))
        self.emergency = self._pressed_mps2 < -COMFORT_MPS2
        return self._pressed_mps2
