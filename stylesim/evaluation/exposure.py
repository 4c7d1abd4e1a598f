"""Importance weights: what drivers of one population say about another, and failure rates per kilometre of that one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.intervals import LEVEL
from stylesim.population import Population
from stylesim.style import STYLE_CLASSES


def sampled_population(corpus: Corpus) -> Population:
    """The population that drove a generated corpus, from its manifest. InputError where it names none."""
    raw = corpus.manifest.get("configuration", {}).get("population")
    if not isinstance(raw, Mapping) or "shares" not in raw:
        raise InputError(
            f"{corpus.path} names no population in its corpus.json: weights need a corpus made by `stylesim generate` "
            "(merged and recorded corpora have none)"
        )
    return Population(str(raw.get("name", "")), tuple(raw["shares"]), str(raw.get("within_class", "interval")))


def style_weights(sampled: Population, wanted: Population) -> dict[str, float]:
    """How much rarer or commoner each style is in `wanted` than in `sampled`: the ratio of the knob's densities.

    Both draw the knob in the same manner within a class, so the ratio is that of the shares. InputError where they do
    not (the densities have no ratio then), or a style of `wanted` was never sampled.
    """
    for population in (sampled, wanted):
        if population.within_class == "neutral":
            raise InputError(f"population {population.name!r} has neutral drivers only: there are no styles to reweigh")
    if sampled.within_class != wanted.within_class:
        raise InputError(
            f"{sampled.name!r} draws drivers within a class by {sampled.within_class!r}, {wanted.name!r} by "
            f"{wanted.within_class!r}: their densities have no ratio"
        )
    missing = [s for s in STYLE_CLASSES if wanted.by_class[s] > 0 and sampled.by_class[s] == 0]
    if missing:
        raise InputError(
            f"{sampled.name!r} has no {', '.join(missing)} drivers, so that it says nothing about {wanted.name!r}"
        )
    return {s: wanted.by_class[s] / sampled.by_class[s] if sampled.by_class[s] else 0.0 for s in STYLE_CLASSES}


def driver_weights(corpus: Corpus, population: Population) -> dict[tuple[str, str], float]:
    """(scene_id, agent_id) -> weight of every commanded driver; what follows from it speaks of `population`.

    A driver's own style is reweighed, not the traffic around it: rare_heavy surrounds it with more rare drivers than
    the weights can undo. InputError as in `style_weights`, and for a driver of no class.
    """
    weights = style_weights(sampled_population(corpus), population)
    found: dict[tuple[str, str], float] = {}
    for scene in corpus:
        for agent_id, driver in zip(scene.tracks.agent_id, scene.tracks.driver, strict=True):
            if driver is not None:
                if driver.name not in weights:
                    raise InputError(f"{scene.scene_id}: driver {agent_id} is {driver.name!r}, none of the six styles")
                found[scene.scene_id, agent_id] = weights[driver.name]
    return found


@dataclass(frozen=True)
class Rate:
    """Events per unit of exposure, with a 95 % interval.

    `events` is the plain count; `effective_drivers` is Kish's effective sample size of the weighted exposure, which
    equals the number of drivers where all weigh and drive the same.
    """

    value: float
    low: float
    high: float
    events: int
    exposure: float  # unweighted
    effective_drivers: float

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; None in place of NaN and infinity."""
        return {k: (v if np.isfinite(v) else None) for k, v in vars(self).items()}


def event_rate(
    events: Int[np.ndarray, " driver"],
    exposure: Float64[np.ndarray, " driver"],
    weight: Float64[np.ndarray, " driver"] | None = None,
) -> Rate:
    """Sum of weight x events over sum of weight x exposure.

    The interval is Fay and Feuer's (1997) gamma interval for weighted sums of Poisson counts; with equal weights it is
    Garwood's exact one. Events of one episode are taken as independent. NaN without exposure.
    """
    from scipy.stats import chi2

    weight = np.ones(len(exposure)) if weight is None else weight
    total = float((weight * exposure).sum())
    count, plain = int(events.sum()), float(exposure.sum())
    if total <= 0:
        return Rate(np.nan, np.nan, np.nan, count, plain, 0.0)
    relative = weight / total
    value, variance = float((relative * events).sum()), float((relative**2 * events).sum())
    largest = float(relative[(exposure > 0) & (weight > 0)].max())
    tail = (1.0 - LEVEL) / 2
    low = variance / (2 * value) * float(chi2.ppf(tail, 2 * value**2 / variance)) if variance > 0 else 0.0
    above, spread = value + largest, variance + largest**2
    high = spread / (2 * above) * float(chi2.ppf(1 - tail, 2 * above**2 / spread))
    share = weight * exposure
    return Rate(value, low, high, count, plain, float(share.sum() ** 2 / (share**2).sum()))
