"""The one smoother, and speed, acceleration and jerk as derivatives of its polynomial."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Float64, Int

# Below this speed the direction of travel is the vehicle's heading, not its velocity's: the velocity of a
# standing vehicle is noise. Chosen: walking speed.
DIRECTION_MIN_SPEED_MPS = 1.0


@dataclass(frozen=True)
class Smoother:
    """Savitzky-Golay: a least-squares polynomial of `order` over `length_s`, moved along each unbroken run.

    REFERENCE section 1 [ours]: 1.1 s, order 3, the same for all sources. At the ends of a run the polynomial of
    its first or last full window is evaluated off-centre; a run shorter than the window is fitted as a whole.
    """

    length_s: float = 1.1
    order: int = 3

    def __post_init__(self) -> None:
        """Refuse a polynomial that has no jerk, or a window of no length."""
        if self.order < 3:
            raise ValueError(f"the smoother needs order 3 or more for a jerk, not {self.order}")
        if not self.length_s > 0:
            raise ValueError(f"length_s must be positive, not {self.length_s}")

    @property
    def least_samples(self) -> int:
        """The shortest run that is smoothed: one sample more than the polynomial has coefficients."""
        return self.order + 2

    def taps(self, dt_s: float) -> int:
        """Samples in a full window: the odd number nearest to length_s / dt_s, at least `least_samples`."""
        odd = 2 * round((self.length_s / dt_s - 1) / 2) + 1
        return max(odd, self.least_samples | 1)


@lru_cache(maxsize=16)
def operators(smoother: Smoother, dt_s: float) -> Float64[np.ndarray, "length place sample derivative"]:
    """What turns the samples of a window into value and first three derivatives at each of its places.

    The first axis counts run lengths from `least_samples` to the full window; shorter ones are padded with 0.
    """
    least, taps = smoother.least_samples, smoother.taps(dt_s)
    result = np.zeros((taps - least + 1, taps, taps, 4))
    factorial = np.cumprod(np.maximum(np.arange(smoother.order + 1), 1))
    for length in range(least, taps + 1):
        for place in range(length):
            at = np.arange(length) - place
            # Row k of the pseudo-inverse gives the k-th Taylor coefficient at `place`, with time in samples.
            taylor = np.linalg.pinv(np.vander(at, smoother.order + 1, increasing=True).astype(np.float64))
            for derivative in range(4):
                scale = factorial[derivative] / dt_s**derivative
                result[length - least, place, :length, derivative] = taylor[derivative] * scale
    result.flags.writeable = False
    return result


def derivatives(
    values: Float[np.ndarray, "agent time channel"],
    run: Int[np.ndarray, "agent time"],
    dt_s: float,
    smoother: Smoother,
) -> Float64[np.ndarray, "agent time channel 4"]:
    """Smoothed value and its first three time derivatives; NaN where `run` is -1 or the run is too short.

    Neighbouring samples with the same number in `run` belong to one unbroken run; nothing is smoothed across runs.
    """
    from stylesim.kinematics.kernels import local_polynomial

    out = np.full((*values.shape, 4), np.nan)
    table = operators(smoother, dt_s)
    local_polynomial(np.ascontiguousarray(values), np.ascontiguousarray(run), table, smoother.least_samples, out)
    return out


@dataclass(frozen=True, eq=False)
class Motion:
    """Smoothed motion of every agent; NaN where its run is shorter than the smoother needs."""

    position_m: Float64[np.ndarray, "agent time 2"]
    direction: Float64[np.ndarray, "agent time 2"]  # unit vector of travel
    speed_mps: Float64[np.ndarray, "agent time"]
    acceleration_mps2: Float64[np.ndarray, "agent time"]  # along the path
    jerk_mps3: Float64[np.ndarray, "agent time"]  # along the path: the third derivative of the distance driven

    @property
    def known(self) -> Bool[np.ndarray, "agent time"]:
        """Where there is a motion."""
        return np.isfinite(self.speed_mps)


def motion(
    position_m: Float[np.ndarray, "agent time 2"],
    heading_rad: Float[np.ndarray, "agent time"],
    run: Int[np.ndarray, "agent time"],
    *,
    dt_s: float,
    smoother: Smoother | None = None,
) -> Motion:
    """Speed, acceleration and jerk along the path from positions.

    With unit tangent u, velocity v, acceleration a and third derivative j of the smoothed position, and s the
    distance driven: ds/dt = |v|, d2s/dt2 = a.u, d3s/dt3 = j.u + |a_across|^2 / |v| (differentiating a.u; the last
    term is what a bend adds, so that constant speed on a circle has no jerk). `run` as in `derivatives`.
    """
    from stylesim.kinematics.kernels import path_motion

    smoother = smoother or Smoother()
    planar, scalar = (*run.shape, 2), run.shape
    result = Motion(
        np.full(planar, np.nan), np.full(planar, np.nan),
        np.full(scalar, np.nan), np.full(scalar, np.nan), np.full(scalar, np.nan),
    )  # fmt: skip
    path_motion(
        np.ascontiguousarray(position_m), np.ascontiguousarray(heading_rad), np.ascontiguousarray(run),
        operators(smoother, dt_s), smoother.least_samples, DIRECTION_MIN_SPEED_MPS,
        result.position_m, result.direction, result.speed_mps, result.acceleration_mps2, result.jerk_mps3,
    )  # fmt: skip
    return result
