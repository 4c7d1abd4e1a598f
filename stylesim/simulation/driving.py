"""How a driver behaves, whatever the simulator: the yellow light, brake response, deceleration, pedal noise.

Sources are in REFERENCE section 5. The quantiles of Gates et al. 2007 are turned into log-normal laws by
ln q85 - ln q15 = 2 * 1.0364 * sigma [ours]: response 0.7 / 1.0 / 1.6 s gives sigma 0.40 (its median 1.0 s is
printed), deceleration 2.2 / 3.0 / 3.9 m/s2 gives sigma 0.28 (median 3.0 m/s2). People differ, and one person
differs between events: the style's own `spread` (0.30 and 0.08) is the first part, what is left the second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from stylesim.simulation.stopping import latest_response_s
from stylesim.style import DriverStyle

# Within one driver: sqrt(0.40^2 - 0.30^2) and sqrt(0.276^2 - 0.08^2), see above.
RESPONSE_SIGMA = 0.26
DECELERATION_SIGMA = 0.264
SHORTEST_RESPONSE_S = 0.4  # chosen, because 0.7 s is the 15 % quantile and no observed stop was quicker than about this
HARDEST_BRAKING_MPS2 = 7.5  # TRID 801675: 821 stops at yellow used 1.51 to 7.47 m/s2
# TRID 801675: the mean of those who stop from 1.6 s before the line; who would need more responds earlier if it can.
HURRIED_BRAKING_MPS2 = 5.9
# REFERENCE section 5: wet road k 2.44 1/s, m 3.0 s (50 % at 3.0 s, 90 % at 3.9 s), against 2.14 and 2.88 on a dry one.
WET_LATER_S, WET_STEEPER = 3.0 - 2.88, 2.44 / 2.14
STANDING_MPS = 0.05  # who is slower stands and stops for sure
LARGEST_Z = 2.5  # draws are clipped there, because a single driver must not respond after 5 s


@dataclass(frozen=True)
class YellowDecision:
    """What one driver does about one yellow light."""

    stop: bool
    response_s: float  # from the onset of yellow until the driver acts; 0 where it goes
    deceleration_mps2: float  # with which it then wishes to brake; NaN where it goes
    impossible: bool = False  # it would have stopped, but nobody could


def stop_probability(
    time_to_line_s: Float[np.ndarray, "*any"] | float, *, midpoint_s: float, slope_per_s: float
) -> Float[np.ndarray, "*any"] | float:
    """P(stop) = 1 / (1 + exp(-k (TTS - m))), REFERENCE section 5 [read]; TTS in s, infinity for who stands."""
    power = np.clip(slope_per_s * (np.asarray(time_to_line_s, np.float64) - midpoint_s), -500.0, 500.0)
    result = 1.0 / (1.0 + np.exp(-power))
    return float(result) if np.ndim(result) == 0 else result


def needed_deceleration(*, speed_mps: float, distance_m: float, response_s: float) -> float:
    """v^2 / (2 (d - v t)), which brings who acts after `response_s` to rest at the line; inf if nothing does."""
    if speed_mps <= 0.0:
        return 0.0
    left = distance_m - speed_mps * response_s
    return speed_mps**2 / (2.0 * left) if left > 0.0 else math.inf


def brake_response(style: DriverStyle, rng: np.random.Generator) -> float:
    """One brake response time in s: log-normal about the driver's own reaction time."""
    z = float(np.clip(rng.standard_normal(), -LARGEST_Z, LARGEST_Z))
    return max(SHORTEST_RESPONSE_S, style.reaction_time_s * math.exp(RESPONSE_SIGMA * z))


def wished_deceleration(style: DriverStyle, rng: np.random.Generator) -> float:
    """One wished deceleration in m/s2 of a stop: log-normal about the driver's comfortable one."""
    z = float(np.clip(rng.standard_normal(), -LARGEST_Z, LARGEST_Z))
    return min(HARDEST_BRAKING_MPS2, style.comfortable_deceleration_mps2 * math.exp(DECELERATION_SIGMA * z))


def decide_at_yellow(
    style: DriverStyle, *, speed_mps: float, distance_m: float, rng: np.random.Generator, wet: bool = False
) -> YellowDecision:
    """Stop or go, drawn once at the onset of yellow from the time to the stop line at the present speed.

    Three draws are taken from `rng` whatever comes out. A driver who stops acts after its brake response; where
    that leaves more than 5.9 m/s2 to brake (with what building up and easing off take, `stopping`), it responds as
    early as it takes (people who stop close to the line do respond earlier), down to 0.4 s; where even then it would
    take more than 7.5 m/s2 nobody could stop, and it goes [ours]. On a wet road the curve lies later and is steeper;
    braking is the same.
    """
    standing = speed_mps < STANDING_MPS
    time_to_line_s = math.inf if standing else distance_m / speed_mps
    midpoint = style.yellow_midpoint_s + (WET_LATER_S if wet else 0.0)
    slope = style.yellow_slope_per_s * (WET_STEEPER if wet else 1.0)
    chance = stop_probability(time_to_line_s, midpoint_s=midpoint, slope_per_s=slope)
    wants_to_stop = bool(rng.random() < chance)
    response = brake_response(style, rng)
    wish = wished_deceleration(style, rng)
    if wants_to_stop and not standing:
        in_time = {"speed_mps": speed_mps, "distance_m": distance_m}
        latest = latest_response_s(**in_time, deceleration_mps2=HARDEST_BRAKING_MPS2)
        if latest >= SHORTEST_RESPONSE_S:
            hurried = latest_response_s(**in_time, deceleration_mps2=HURRIED_BRAKING_MPS2)
            latest = max(hurried, SHORTEST_RESPONSE_S)
        response = min(response, latest)
    if not wants_to_stop or response < SHORTEST_RESPONSE_S:
        return YellowDecision(stop=False, response_s=0.0, deceleration_mps2=math.nan, impossible=wants_to_stop)
    return YellowDecision(stop=True, response_s=response, deceleration_mps2=wish)


def pedal_noise(
    style: DriverStyle, *, n_frames: int, dt_s: float, rng: np.random.Generator
) -> Float[np.ndarray, " time"]:
    """An Ornstein-Uhlenbeck acceleration noise, m/s2: stationary sd `pedal_noise_mps2`, its correlation time.

    For simulators that take an acceleration; SUMO's EIDM has an equivalent of its own (`sumo.vehicles`).
    """
    keep = math.exp(-dt_s / style.pedal_noise_time_s)
    shocks = rng.standard_normal(n_frames) * style.pedal_noise_mps2
    shocks[1:] *= math.sqrt(1.0 - keep**2)
    noise = np.empty(n_frames)
    value = 0.0
    for frame, shock in enumerate(shocks):
        value = value * keep + float(shock)
        noise[frame] = value
    return noise
