"""What a foot makes of a simulator's speeds: no jumps of the acceleration, and restlessness.

A car-following model may change its acceleration from one step to the next as it likes; pedals, brakes and tyres
cannot. The driven vehicle follows the model's motion with bounded acceleration and jerk: exactly, wherever that moves
as a vehicle can, else it falls behind or runs ahead by some centimetres and comes back. On top lies the style's pedal
noise: Ornstein-Uhlenbeck draws through a lagging foot, whose deviation from the wished motion the driver corrects as
a damped spring does (e'' = noise - 2 z w e' - w^2 e). Many small jerks at the pace at which people correct, rather
than rare big ones; deviations stay within some decimetres, so that the traffic around need not know of them.

Decided from style and seed, step by step, before anybody labels anything; nothing later than a step is read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.simulation.stopping import EMERGENCY_MPS2, HARD_JERK_MPS3, HARD_MPS2, JERK_MPS3
from stylesim.simulation.wander import WanderSwitch
from stylesim.style import DriverStyle

# Of the foot behind its draws; chosen, because then 0.7 m/s2 of noise jerk by 8 m/s3 at the 99.9th percentile.
LAG_S = 0.3
CORRECTS_RAD_PER_S, DAMPING = 1.5, 0.5  # chosen, because people correct their speed in a few seconds, not quite calmly
# While an emergency lasts, towards a stand, and for what lies beyond `FREE_M`; chosen: two thirds of a second.
STIFF_RAD_PER_S = 3.0
SUDDEN = 2.0  # times the jerk of a calm foot; chosen, between it and the 2.5 with which hard stops begin
FREE_M = 1.5  # deviation that the calm correction is left with; chosen, three sds of 0.8 m/s2 of noise
CALM_MPS = 6.0  # below this speed the restlessness fades: who stands does not press; chosen, walking out of a queue
STRAINED_MPS2 = 3.0  # of braking, from which on restlessness fades, gone at 4.5; chosen: a usual hard stop at a light
# Of braking, whose deviations may need more than 4.5; chosen: else 1 % of stops ended over the line.
ALMOST_HARD_MPS2 = 4.0
LAST_MPS2 = 0.3  # of braking, in the last moment before standing; chosen, because it is not felt
JUMP_MPS2 = 20.0  # no vehicle does that: it was put elsewhere, and the foot begins anew
SETTLED_STEPS = 400  # after which an answer to one draw has died away


@lru_cache(maxsize=64)
def noise_gain(correlation_time_s: float, dt_s: float) -> float:
    """Sd of the acceleration per unit of independent draws, at full speed: from the answer to one draw [ours]."""
    keep, lag = math.exp(-dt_s / correlation_time_s), dt_s / LAG_S
    target, pressed, ahead, rate, total = 1.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(SETTLED_STEPS):
        pressed += (target - pressed) * lag
        push = pressed - 2.0 * DAMPING * CORRECTS_RAD_PER_S * rate - CORRECTS_RAD_PER_S**2 * ahead
        rate += push * dt_s
        ahead += rate * dt_s
        total += push**2
        target *= keep
    return math.sqrt(total)


class Foot:
    """The feet of many drivers, each advanced by one step of `dt_s` at a time."""

    def __init__(self, styles: Sequence[DriverStyle], *, dt_s: float) -> None:
        n = len(styles)
        self._dt = dt_s
        self._keep, self._kick = np.zeros(n), np.zeros(n)
        for row, style in enumerate(styles):
            self.retune(row, style)
        self._target, self._pressed, self._ahead, self._rate, self._acceleration = (np.zeros(n) for _ in range(5))
        self._model_mps = np.full(n, np.nan)  # the simulator's speed a step ago; NaN before the first one

    def retune(self, row: int, style: DriverStyle) -> None:
        """The foot of another person from here on."""
        self._keep[row] = math.exp(-self._dt / style.pedal_noise_time_s)
        self._kick[row] = style.pedal_noise_mps2 / noise_gain(style.pedal_noise_time_s, self._dt)

    def advance(
        self,
        rows: Int64[np.ndarray, " vehicle"] | slice,
        model_mps: Float64[np.ndarray, " vehicle"],
        draw: Float64[np.ndarray, " vehicle"],
    ) -> tuple[Float64[np.ndarray, " vehicle"], Float64[np.ndarray, " vehicle"]]:
        """One step of these drivers: m ahead of where the simulator has them, and their speed in m/s.

        `model_mps` is the simulator's speed of the step, `draw` one standard normal draw of each.
        """
        dt = self._dt
        wished = (model_mps - self._model_mps[rows]) / dt
        new = ~(np.abs(wished) <= JUMP_MPS2)
        wished = np.where(new, 0.0, wished)
        before = np.where(new, model_mps, self._model_mps[rows] + self._rate[rows])
        ahead, rate, last = (np.where(new, 0.0, state[rows]) for state in (self._ahead, self._rate, self._acceleration))
        target = self._keep[rows] * self._target[rows] + self._kick[rows] * draw
        pressed = self._pressed[rows] + (target - self._pressed[rows]) * (dt / LAG_S)
        pace = np.minimum(before / CALM_MPS, 1.0)
        push = pace * pace * (3.0 - 2.0 * pace) * pressed
        # A stop beyond the limit builds up faster than a calm foot follows: it is told by its beginning, too.
        hard = (wished < -HARD_MPS2) | ((wished < 0.0) & (wished - last < -SUDDEN * JERK_MPS3 * dt))
        # Who brakes hard does not play with the pedal, and who comes to a stand does so where he meant to.
        strain = np.minimum(np.maximum((-wished - STRAINED_MPS2) / (HARD_MPS2 - STRAINED_MPS2), 0.0), 1.0)
        exact = np.maximum(np.where(hard, 1.0, strain), 1.0 - pace)
        push *= 1.0 - np.where(hard, 1.0, strain)
        spring = CORRECTS_RAD_PER_S + (STIFF_RAD_PER_S - CORRECTS_RAD_PER_S) * exact
        push -= 2.0 * (DAMPING + (1.0 - DAMPING) * exact) * spring * rate + spring**2 * ahead
        push -= STIFF_RAD_PER_S**2 * (ahead - np.minimum(np.maximum(ahead, -FREE_M), FREE_M))
        most = np.where(hard | (wished < -ALMOST_HARD_MPS2), -EMERGENCY_MPS2, -HARD_MPS2)
        lowest = np.maximum(most, -LAST_MPS2 - np.sqrt(2.0 * JERK_MPS3 * before))
        change = np.where(hard, HARD_JERK_MPS3, JERK_MPS3) * dt
        driven = np.minimum(np.maximum(wished + push, lowest), HARD_MPS2)
        driven = np.minimum(np.maximum(driven, last - change), last + change)
        speed = np.maximum(before + driven * dt, 0.0)
        self._acceleration[rows] = (speed - before) / dt
        self._rate[rows] = speed - model_mps
        self._ahead[rows] = ahead + (speed - model_mps) * dt
        self._target[rows], self._pressed[rows], self._model_mps[rows] = target, pressed, model_mps
        return self._ahead[rows], speed


def footed(
    styles: Sequence[DriverStyle],
    model_mps: Float64[np.ndarray, "agent time"],
    *,
    dt_s: float,
    streams: Sequence[np.random.Generator],
    switch: WanderSwitch | None = None,
) -> tuple[Float64[np.ndarray, "agent time"], Float64[np.ndarray, "agent time"]]:
    """Every driver and frame of a log at once: m ahead of the simulator's place, and the speed in m/s.

    `model_mps` is 0 where a driver is not there. `streams[i]` gives driver i's draws and nobody else's; their number
    depends on the frames only. From `switch.frame` on its agent has the other style's foot, and with its stream other
    draws. ValueError where the lengths differ.
    """
    agents, frames = model_mps.shape
    if not len(styles) == len(streams) == agents:
        raise ValueError(f"{len(styles)} styles, {len(streams)} streams for {agents} drivers")
    draws = np.empty((frames, agents))
    for column, rng in enumerate(streams):
        draws[:, column] = rng.standard_normal(frames)
    if switch is not None and switch.stream is not None:
        draws[switch.frame :, switch.agent] = switch.stream.standard_normal(max(0, frames - switch.frame))
    foot, everybody = Foot(styles, dt_s=dt_s), slice(None)
    ahead, speed = np.empty((frames, agents)), np.empty((frames, agents))
    for frame, model in enumerate(np.ascontiguousarray(model_mps.T)):
        if switch is not None and frame == switch.frame:
            foot.retune(switch.agent, switch.style)
        ahead[frame], speed[frame] = foot.advance(everybody, model, draws[frame])
    return np.ascontiguousarray(ahead.T), np.ascontiguousarray(speed.T)
