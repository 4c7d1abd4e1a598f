"""Effect sizes, tests and reliabilities, with intervals that resample units, then drivers (REFERENCE section 8)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.evaluation.intervals import LEVEL, Estimate, bootstrap_weights, status_of
from stylesim.randomness import stream

DRAWS = 500  # chosen: an end of a 95 % interval then rests on 12 draws; there are hundreds of intervals
PERMUTATIONS = 2000  # chosen: the smallest p is 0.0005

Statistic = Callable[[Float64[np.ndarray, "draw driver"]], Float64[np.ndarray, " draw"]]


def resampled(statistic: Statistic, unit: Sequence[str], *, seed: int, purpose: str) -> Estimate:
    """A statistic of weighted drivers with a percentile bootstrap interval; refused where there are too few.

    With fewer than 3 units only drivers are resampled ("within site"). NaN ends where no resample has a value.
    """
    names, group = np.unique(np.asarray(unit, dtype=str), return_inverse=True)
    n = len(group)
    status = status_of(n, len(names))
    if status == "too few":
        return Estimate(np.nan, np.nan, np.nan, n, len(names), status)
    group = group if status == "general" else np.zeros(n, np.int64)
    rng = stream(seed, 0, "", f"analysis {purpose}")
    value = float(statistic(np.ones((1, n)))[0])
    drawn = np.concatenate([statistic(w) for w in bootstrap_weights(group.astype(np.int64), rng, DRAWS)])
    drawn = drawn[np.isfinite(drawn)]
    tail = 100 * (1.0 - LEVEL) / 2
    low, high = np.percentile(drawn, [tail, 100 - tail]) if len(drawn) else (np.nan, np.nan)
    return Estimate(value, float(low), float(high), n, len(names), status)


def cliffs_delta(
    first: Float64[np.ndarray, "draw driver"],
    second: Float64[np.ndarray, "draw driver"],
    value: Float64[np.ndarray, " driver"],
) -> Float64[np.ndarray, " draw"]:
    """P(X > Y) - P(X < Y) for X of the first group, Y of the second, given as weights of the same drivers.

    Cliff 1993; NaN where a group is empty.
    """
    _, group = np.unique(value, return_inverse=True)
    order = np.argsort(group, kind="stable")
    start = np.concatenate([[0], np.flatnonzero(np.diff(group[order])) + 1])
    a, b = (np.add.reduceat(w[:, order], start, axis=1) for w in (first, second))
    below = np.cumsum(b, axis=1) - b
    total = b.sum(axis=1, keepdims=True)
    wins = (a * (below - (total - below - b))).sum(axis=1)
    scale = a.sum(axis=1) * total[:, 0]
    return np.asarray(wins / np.where(scale > 0, scale, np.nan))


def holm(p: Sequence[float]) -> list[float]:
    """Holm's (1979) adjusted p-values, in the order given."""
    order = np.argsort(p, kind="stable")
    adjusted = np.empty(len(p))
    running = 0.0
    for place, i in enumerate(order):
        running = max(running, min(1.0, (len(p) - place) * p[i]))
        adjusted[i] = running
    return [float(v) for v in adjusted]


def between_groups_p(
    value: Float64[np.ndarray, "driver quantity"],
    group: Int64[np.ndarray, " driver"],
    stratum: Int64[np.ndarray, " driver"],
    *,
    seed: int,
    purpose: str,
) -> Float64[np.ndarray, " quantity"]:
    """P of "the groups do not differ": the groups' names are shuffled within each stratum, ranks are compared.

    The statistic is Kruskal and Wallis' sum over groups of (sum of ranks)^2 / n; p counts the true order as one of the
    orders, so it is never 0. Within a stratum: what a whole scene shares (site, hour, traffic) tells nothing.
    """
    from scipy.stats import rankdata

    rank = rankdata(value, axis=0) - (len(value) + 1) / 2
    member = np.eye(int(group.max()) + 1)[group]
    size = np.maximum(member.sum(axis=0), 1)

    def statistic(order: Int64[np.ndarray, " driver"]) -> Float64[np.ndarray, " quantity"]:
        return np.asarray(((member.T @ rank[order]) ** 2 / size[:, None]).sum(axis=0))

    rng = stream(seed, 0, "", f"permutation {purpose}")
    place = np.lexsort((np.arange(len(group)), stratum))
    true = statistic(np.arange(len(group)))
    reached = np.ones(value.shape[1])
    for _ in range(PERMUTATIONS):
        order = np.empty(len(group), np.int64)
        order[place] = np.lexsort((rng.random(len(group)), stratum))
        reached += statistic(order) >= true * (1 - 1e-12)
    return np.asarray(reached / (PERMUTATIONS + 1))


def icc1(
    weight: Float64[np.ndarray, "draw driver"],
    count: Float64[np.ndarray, " driver"],
    total: Float64[np.ndarray, " driver"],
    square: Float64[np.ndarray, " driver"],
) -> Float64[np.ndarray, " draw"]:
    """ICC(1) of drivers' windows from each driver's count, sum and sum of squares (Shrout and Fleiss 1979).

    One-way random effects, unequal counts: k0 = (N - sum n^2 / N) / (drivers - 1). NaN where nothing varies.
    """
    drivers, n = weight.sum(axis=1), weight @ count
    grand = (weight @ total) / n
    between = weight @ (total**2 / count) - n * grand**2
    within = weight @ (square - total**2 / count)
    k0 = (n - (weight @ count**2) / n) / np.maximum(drivers - 1, 1)
    msb, msw = between / np.maximum(drivers - 1, 1), within / np.maximum(n - drivers, 1)
    scale = msb + (k0 - 1) * msw
    return np.asarray((msb - msw) / np.where(scale > 0, scale, np.nan))


def kappa(count: Float64[np.ndarray, "draw style style"]) -> Float64[np.ndarray, " draw"]:
    """Cohen's kappa, unweighted; NaN where chance alone agrees always."""
    total = count.sum(axis=(1, 2))
    agreed = np.trace(count, axis1=1, axis2=2) / total
    chance = (count.sum(axis=2) * count.sum(axis=1)).sum(axis=1) / total**2
    return np.asarray((agreed - chance) / np.where(chance < 1 - 1e-12, 1 - chance, np.nan))
