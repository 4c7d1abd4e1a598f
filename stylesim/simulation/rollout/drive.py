"""A styled driver at its pedals: wish, leader, curve, stop line; IDM with a cool head, a lagged and restless foot."""

from __future__ import annotations

import math

import numpy as np

from stylesim.simulation.driving import pedal_noise
from stylesim.simulation.rollout.path import Path
from stylesim.style import DriverStyle

HARDEST_MPS2 = 8.0  # the limit of human braking in an emergency
JERK_MPS3 = 12.0  # how fast pedals are pressed and released; people stay below 15
PEDAL_LAG = 0.3  # chosen: drivers anticipate, so only this part of the reaction time is left as a lag of the pedal
COOLNESS = 0.99  # Kesting, Treiber, Helbing 2010 [recalled]
CURVE_MPS2 = 2.5  # lateral acceleration in curves at most; chosen, because wander adds up to the 4 m/s2 that hold
GENTLY = 0.5  # of the comfortable deceleration is used before curves; chosen, because a foot follows late
LOOK_M = 120.0  # at curves ahead
STANDS_BEFORE_M = 0.3  # a stop line at least
NEAR_EASE, MARGIN = 0.7, 1.15  # the pedal lags: who needs this share of its ease brakes with that much more; chosen
CALM_MPS = 5.0  # below this speed the restlessness fades: who stands does not press


def curve_speed_mps(path: Path, s_m: float, ease_mps2: float) -> float:
    """Speed that keeps the lateral acceleration in the curves ahead, with the style's ease before them."""
    first, last = np.searchsorted(path.s_m, (s_m, s_m + LOOK_M))
    bend = path.curvature_per_m[first : max(last, first + 1)]
    if not len(bend):
        return math.inf
    side = min(CURVE_MPS2, ease_mps2)
    allowed = side / np.maximum(bend, 1e-6)
    rest = np.maximum(path.s_m[first : first + len(bend)] - s_m, 0.0)
    return float(np.sqrt(allowed + 2.0 * GENTLY * ease_mps2 * rest).min())


def idm_mps2(style: DriverStyle, speed: float, wish: float) -> float:
    """Free-road acceleration of the IDM (Treiber et al. 2000 [recalled]); above the wish it eases off."""
    bold, ease = style.max_acceleration_mps2, style.comfortable_deceleration_mps2
    if wish < 0.1:
        return -ease
    return max(bold * (1.0 - (speed / wish) ** 4), -ease)


def behind_mps2(
    style: DriverStyle, speed: float, free: float, leader_mps: float, leader_mps2: float, gap: float
) -> float:
    """IDM behind a leader, tempered by the constant-acceleration heuristic (Kesting et al. 2010 [recalled])."""
    bold, ease = style.max_acceleration_mps2, style.comfortable_deceleration_mps2
    gap = max(gap, 0.1)
    closing = speed - leader_mps
    wanted = style.min_gap_m + max(0.0, speed * style.time_headway_s + speed * closing / (2 * math.sqrt(bold * ease)))
    idm = min(free, bold) - bold * (wanted / gap) ** 2
    accelerates = min(leader_mps2, bold)
    if accelerates < 0 and leader_mps * closing <= -2 * gap * accelerates:
        heuristic = speed**2 * accelerates / (leader_mps**2 - 2 * gap * accelerates)
    else:
        heuristic = accelerates - max(closing, 0.0) ** 2 / (2 * gap)
    if idm < heuristic:
        idm = (1 - COOLNESS) * idm + COOLNESS * (heuristic + ease * math.tanh((idm - heuristic) / ease))
    return max(min(free, idm), -HARDEST_MPS2)


def stopping_mps2(style: DriverStyle, speed: float, free: float, gap: float, ease_mps2: float) -> float:
    """Before a stop line: the IDM's braking term, and at least what is needed where that is near `ease_mps2`."""
    if gap <= 0.0:
        return -HARDEST_MPS2
    bold = style.max_acceleration_mps2
    wanted = 0.5 + speed**2 / (2 * math.sqrt(bold * ease_mps2))
    result = min(free, bold) - bold * (wanted / gap) ** 2
    needed = speed**2 / (2.0 * max(gap - STANDS_BEFORE_M, 0.1))
    if needed > NEAR_EASE * ease_mps2:
        result = min(result, -MARGIN * needed)
    return max(result, -HARDEST_MPS2)


class Foot:
    """From the wished acceleration to the one that is pressed, and its noise over all frames of the episode."""

    def __init__(self, style: DriverStyle, frames: int, dt_s: float, rng: np.random.Generator, start: float) -> None:
        self._dt_s, self._lag_s = dt_s, max(PEDAL_LAG * style.reaction_time_s, dt_s)
        self._noise = pedal_noise(style, n_frames=frames, dt_s=dt_s, rng=rng)
        self._foot = self.pressed_mps2 = start

    def press(self, wish_mps2: float, speed_mps: float, frame: int) -> float:
        """The acceleration of the step after that frame, m/s2."""
        self._foot += (wish_mps2 - self._foot) * self._dt_s / self._lag_s
        noise = float(self._noise[frame]) * min(speed_mps / CALM_MPS, 1.0)
        wanted = max(self._foot + noise, -HARDEST_MPS2)
        most = JERK_MPS3 * self._dt_s
        self.pressed_mps2 += min(max(wanted - self.pressed_mps2, -most), most)
        return max(self.pressed_mps2, -speed_mps / self._dt_s)
