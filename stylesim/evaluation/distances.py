"""Distances between two distributions that are known as histograms on one grid."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

# Waymo's Sim Agents scores smooth their histograms by a pseudo count of 0.1 per bin [read].
PSEUDO_COUNT = 0.1
LEAST_CELL_S = 10.0  # chosen: less traffic than that would be one or two vehicles, whose weight could be any
LIKELIHOOD_BINS = 20  # chosen: near the 10 to 20 bins of Sim Agents; finer ones would be mostly empty


def wasserstein(
    first: Float64[np.ndarray, "*any bin"], second: Float64[np.ndarray, "*any bin"], width: float
) -> Float64[np.ndarray, "*any"]:
    """Wasserstein-1 distance (the area between the distribution functions); NaN where one is empty."""
    total = [h.sum(axis=-1, keepdims=True) for h in (first, second)]
    cdf = [np.cumsum(h, axis=-1) / np.where(t > 0, t, np.nan) for h, t in zip((first, second), total, strict=True)]
    return np.asarray(np.abs(cdf[0] - cdf[1]).sum(axis=-1) * width)


def likelihood(sim: Float64[np.ndarray, " bin"], real: Float64[np.ndarray, " bin"], samples: float) -> float:
    """Exp of the mean log likelihood of the real values under the simulated histogram, as Sim Agents scores it.

    `samples` is how many independent values the simulated histogram rests on, for the pseudo count. 1 would be a
    simulation that puts everything into the one bin where all real values are; see `best_likelihood`.
    """
    p, q = _coarse(sim), _coarse(real)
    if p.sum() <= 0 or q.sum() <= 0:
        return float("nan")
    smooth = p / p.sum() * samples + PSEUDO_COUNT
    return float(np.exp((q / q.sum() * np.log(smooth / smooth.sum())).sum()))


def best_likelihood(real: Float64[np.ndarray, " bin"]) -> float:
    """What a simulation with exactly the real distribution reaches: exp of minus its entropy."""
    q = _coarse(real)
    if q.sum() <= 0:
        return float("nan")
    q = q[q > 0] / q.sum()
    return float(np.exp((q * np.log(q)).sum()))


def _coarse(histogram: Float64[np.ndarray, " bin"]) -> Float64[np.ndarray, " coarse"]:
    return histogram.reshape(LIKELIHOOD_BINS, -1).sum(axis=1)


def quantile(
    histogram: Float64[np.ndarray, "*any bin"], share: float, low: float, width: float
) -> Float64[np.ndarray, "*any"]:
    """The value that `share` of the histogram lies below, linear within a bin; NaN where it is empty."""
    total = histogram.sum(axis=-1, keepdims=True)
    cdf = np.cumsum(histogram, axis=-1) / np.where(total > 0, total, np.nan)
    bins = histogram.shape[-1]
    place = np.minimum((cdf < share).sum(axis=-1), bins - 1)
    above = np.take_along_axis(cdf, place[..., None], axis=-1)[..., 0]
    before = np.take_along_axis(cdf, np.maximum(place - 1, 0)[..., None], axis=-1)[..., 0]
    below = np.where(place > 0, before, 0.0)
    within = (share - below) / np.where(above > below, above - below, 1.0)
    value = low + (place + within) * width
    return np.where(total[..., 0] > 0, value, np.nan)


def matched(
    histogram: Float64[np.ndarray, "cell bin"], to: Float64[np.ndarray, "cell bin"]
) -> tuple[Float64[np.ndarray, " bin"], Float64[np.ndarray, " bin"], float]:
    """Both summed over cells, the first weighted so that its cells hold what those of `to` hold.

    Only cells that both have for LEAST_CELL_S count. The last is the share of `to` in them: what is spoken of.
    """
    own, wanted = histogram.sum(axis=1), to.sum(axis=1)
    both = (own >= LEAST_CELL_S) & (wanted >= LEAST_CELL_S)
    if not both.any():
        return np.zeros(histogram.shape[1]), np.zeros(to.shape[1]), 0.0
    weight = np.where(both, wanted / np.where(own > 0, own, 1.0), 0.0)
    return weight @ histogram, both.astype(float) @ to, float(wanted[both].sum() / wanted.sum())
