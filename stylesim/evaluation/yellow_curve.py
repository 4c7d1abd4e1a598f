"""P(stop) by time to the stop line with Wilson intervals, held against a published curve; red-running and its trend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.special import expit
from scipy.stats import binomtest, norm

from stylesim.evaluation.approaches import Approaches

CONFIDENCE = 0.95
BIN_S = 0.25  # the width in which the neutral curve is judged
FROM_S, TO_S = 1.0, 6.0


@dataclass(frozen=True)
class Share:
    """A share of `n` with its Wilson 95 % interval; NaN where n is 0."""

    hits: int
    n: int

    @property
    def value(self) -> float:
        """The share."""
        return self.hits / self.n if self.n else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Its interval (Wilson 1927)."""
        if not self.n:
            return float("nan"), float("nan")
        found = binomtest(self.hits, self.n).proportion_ci(CONFIDENCE, method="wilson")
        return float(found.low), float(found.high)


@dataclass(frozen=True)
class CurveBin:
    """The approaches with a time to the stop line in [low_s, high_s)."""

    low_s: float
    high_s: float
    stopped: Share
    published: float  # mean of the published curve over these approaches
    deceleration_mps2: float  # mean over who stopped; NaN where nobody did


def stop_curve(found: Approaches, *, slope_per_s: float, midpoint_s: float) -> tuple[CurveBin, ...]:
    """P(stop) from 1 to 6 s in steps of 0.25 s, beside the logistic curve of that slope and midpoint."""
    bins = []
    for low in np.arange(FROM_S, TO_S, BIN_S):
        here = (found.tts_s >= low) & (found.tts_s < low + BIN_S)
        stops = here & found.stopped
        published = expit(slope_per_s * (found.tts_s[here] - midpoint_s))
        braking = found.deceleration_mps2[stops]
        bins.append(
            CurveBin(
                float(low),
                float(low + BIN_S),
                Share(int(stops.sum()), int(here.sum())),
                float(published.mean()) if here.any() else float("nan"),
                float(braking.mean()) if stops.any() else float("nan"),
            )
        )
    return tuple(bins)


def curve_rmse(bins: Sequence[CurveBin]) -> float:
    """Root mean square of measured minus published P(stop) over the bins that hold approaches."""
    gaps = [item.stopped.value - item.published for item in bins if item.stopped.n]
    return float(np.sqrt(np.mean(np.square(gaps)))) if gaps else float("nan")


def deceleration_near(found: Approaches, tts_s: float) -> tuple[float, int]:
    """Mean deceleration, and the number, of the stops within 0.25 s of that time to the stop line."""
    near = found.stopped & (np.abs(found.tts_s - tts_s) <= BIN_S)
    return (float(found.deceleration_mps2[near].mean()) if near.any() else float("nan")), int(near.sum())


def ran_red(found: Approaches) -> Share:
    """Who crossed 0.1 s after the onset of red or later, of all."""
    return Share(int(found.ran_red.sum()), len(found))


def decreases(shares: Sequence[Share]) -> list[int]:
    """Places whose share lies below the one before it, beyond both intervals."""
    return [place for place in range(1, len(shares)) if shares[place].interval[1] < shares[place - 1].interval[0]]


def cochran_armitage(
    shares: Sequence[Share], scores: Float64[np.ndarray, " share"] | None = None
) -> tuple[float, float]:
    """The z and the one-sided p of a rising trend of the shares over the scores (0, 1, 2 ...); Armitage 1955.

    (NaN, NaN) where nobody, or everybody, is a hit.
    """
    n = np.array([share.n for share in shares], np.float64)
    hits = np.array([share.hits for share in shares], np.float64)
    score = np.arange(len(shares), dtype=np.float64) if scores is None else scores
    mean = hits.sum() / n.sum() if n.sum() else float("nan")
    centred = score - (n * score).sum() / n.sum()
    variance = mean * (1.0 - mean) * (n * centred**2).sum()
    if not variance > 0:
        return float("nan"), float("nan")
    z = float((hits * centred).sum() / np.sqrt(variance))
    return z, float(norm.sf(z))
