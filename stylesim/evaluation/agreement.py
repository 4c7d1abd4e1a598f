"""How well commanded and measured styles agree: statistics of a weighted sample, for all resamples at once.

Every function takes `weight` [draw driver], how often each driver is in each resample; the sample itself is one row of
ones. `share` [driver measured] is the share of a driver's windows that measured as each class (whole trips: 0 or 1).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int, Int64

from stylesim.style import STYLE_CLASSES


def confusion(
    weight: Float64[np.ndarray, "draw driver"],
    commanded: Int[np.ndarray, " driver"],
    share: Float64[np.ndarray, "driver measured"],
) -> Float64[np.ndarray, "draw commanded measured"]:
    """Drivers of each commanded class (the six) that measured as each class."""
    result = np.zeros((len(weight), len(STYLE_CLASSES), share.shape[1]))
    for place in range(len(STYLE_CLASSES)):
        own = commanded == place
        result[:, place] = weight[:, own] @ share[own]
    return result


def balanced_accuracy(count: Float64[np.ndarray, "draw 6 6"]) -> Float64[np.ndarray, " draw"]:
    """Mean over the commanded classes present of the share that measured as commanded (scikit-learn's definition)."""
    total = count.sum(axis=2)
    hit = np.diagonal(count, axis1=1, axis2=2) / np.where(total > 0, total, np.nan)
    return np.asarray(np.nansum(hit, axis=1) / (total > 0).sum(axis=1))


def quadratic_kappa(count: Float64[np.ndarray, "draw 6 6"]) -> Float64[np.ndarray, " draw"]:
    """Cohen's kappa, disagreement weighed by the squared distance of the classes' ranks; NaN where all are in one."""
    n = count.shape[1]
    penalty = (np.arange(n)[:, None] - np.arange(n)[None]) ** 2.0
    total = count.sum(axis=(1, 2))
    expected = np.einsum("di,dj->dij", count.sum(axis=2), count.sum(axis=1)) / total[:, None, None]
    chance = (penalty * expected).sum(axis=(1, 2))
    return 1.0 - (penalty * count).sum(axis=(1, 2)) / np.where(chance > 0, chance, np.nan)


def _ranks(
    weight: Float64[np.ndarray, "draw driver"], value: Float64[np.ndarray, " driver"]
) -> Float64[np.ndarray, "draw driver"]:
    """Average rank of each driver's value within each resample (a driver that is in it twice counts twice)."""
    _, group = np.unique(value, return_inverse=True)
    order = np.argsort(group, kind="stable")
    start = np.concatenate([[0], np.flatnonzero(np.diff(group[order])) + 1])
    mass = np.add.reduceat(weight[:, order], start, axis=1)
    middle = np.cumsum(mass, axis=1) - (mass - 1.0) / 2.0
    return np.asarray(middle[:, group])


def spearman(
    weight: Float64[np.ndarray, "draw driver"],
    first: Float64[np.ndarray, " driver"],
    second: Float64[np.ndarray, " driver"],
) -> Float64[np.ndarray, " draw"]:
    """Spearman's rank correlation with average ranks of ties; NaN where one of the two does not vary."""
    a, b = _ranks(weight, first), _ranks(weight, second)
    total = weight.sum(axis=1, keepdims=True)
    a = a - (weight * a).sum(axis=1, keepdims=True) / total
    b = b - (weight * b).sum(axis=1, keepdims=True) / total
    scale = np.sqrt((weight * a * a).sum(axis=1) * (weight * b * b).sum(axis=1))
    return np.asarray((weight * a * b).sum(axis=1) / np.where(scale > 0, scale, np.nan))


def class_rank(style: Int64[np.ndarray, " driver"]) -> Float64[np.ndarray, " driver"]:
    """6 for aggressive to 1 for timid, so that bolder is higher, as for the knob."""
    return np.asarray(len(STYLE_CLASSES) - style, np.float64)
