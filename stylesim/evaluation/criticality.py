"""`criticality`: surrogate safety and collisions by style, per kilometre, also as another population has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.driver_criticality import NOBODY, DriverCriticality, drivers_criticality
from stylesim.evaluation.exposure import Rate, event_rate, sampled_population, style_weights
from stylesim.evaluation.intervals import DRAWS, LEVEL, Estimate, bootstrap_weights, status_of
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.style import STYLE_CLASSES

FORMAT = "stylesim-criticality"
SCHEMA_VERSION = 1
PER_KM = 1000.0  # rates are per so many kilometres
BY = ("commanded", "tdbm", "kdsc")

# Figure of a style: the quantile over its drivers of one of their own figures.
MEASURES: Mapping[str, tuple[str, float]] = {
    "ttc_p5_s": ("ttc_p5_s", 0.5),
    "ttc_min_s": ("ttc_min_s", 0.5),
    "headway_p5_s": ("headway_p5_s", 0.5),
    "headway_min_s": ("headway_min_s", 0.5),
    "pet_min_s": ("pet_min_s", 0.5),
    "deceleration_max_mps2": ("deceleration_max_mps2", 0.5),
    "ttc_of_closest_5_percent_s": ("ttc_min_s", 0.05),
    "pet_of_closest_5_percent_s": ("pet_min_s", 0.05),
}
EVENTS = ("collisions_charged", "in_collisions", "ttc_conflicts", "deceleration_conflicts", "pet_conflicts")


@dataclass(frozen=True, eq=False)
class StyleCriticality:
    """One row of the table: the drivers of one style (or all), their measures and their rates per 1,000 km."""

    style: str
    drivers: int
    km: float
    measures: Mapping[str, Estimate]
    rates: Mapping[str, Rate]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "style": self.style,
            "drivers": self.drivers,
            "km": self.km,
            "measures": {name: value.to_dict() for name, value in self.measures.items()},
            "rates_per_1000_km": {name: value.to_dict() for name, value in self.rates.items()},
        }


@dataclass(frozen=True, eq=False)
class Criticality:
    """Rows by style, all drivers as they are, and (where asked for) all drivers as another population.

    `counts` says how collisions came about. `about` names the corpus and both populations.
    """

    by: str
    rows: tuple[StyleCriticality, ...]
    counts: Mapping[str, int]
    about: Mapping[str, Any]
    drivers: DriverCriticality

    def row(self, style: str) -> StyleCriticality:
        """The row of that style; KeyError if there is none."""
        for one in self.rows:
            if one.style == style:
                return one
        raise KeyError(style)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, without the drivers."""
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "by": self.by,
            "rows": [one.to_dict() for one in self.rows],
            "counts": dict(self.counts),
            "about": dict(self.about),
        }


def criticality(
    corpus: Corpus,
    *,
    as_population: Population | str | None = None,
    by: str = "commanded",
    seed: int = 0,
    draws: int = DRAWS,
    progress: Callable[[int, int], None] | None = None,
) -> Criticality:
    """Criticality of every motor vehicle of a corpus, by commanded style, or by label where it was labelled.

    With `as_population` (a population or its name) one more row: the drivers of a generated corpus weighted as if
    that population had been drawn, with the effective sample size in its rates. `seed`, `draws`: of the bootstrap.
    InputError for an unknown `by`, labels that were not made, or weights that do not exist (`exposure`).
    """
    if by not in BY:
        raise InputError(f"by is one of {', '.join(BY)}, not {by!r}")
    wanted = Population.load(as_population) if isinstance(as_population, str) else as_population
    weights = None if wanted is None else style_weights(sampled_population(corpus), wanted)
    labels = None if by == "commanded" else corpus.labels(by, "track")
    table = drivers_criticality(corpus, progress=progress)
    drivers = table.drivers
    names: Sequence[str] = drivers.style
    order: tuple[str, ...] = STYLE_CLASSES
    if labels is not None:
        of = {k: labels.class_name(i) for i, k in enumerate(zip(labels.scene_id, labels.agent_id, strict=True))}
        names = [of.get(key, NOBODY) for key in zip(drivers.scene_id, drivers.agent_id, strict=True)]
        order = (*labels.classes, "undetermined")
    style = np.array(names, dtype=object)
    plain = np.ones(len(style))
    others = sorted(set(names) - set(order))
    rows = [
        _row(name, drivers, style == name, plain, seed=seed, draws=draws)
        for name in (*order, *others)
        if name not in others or (style == name).any()
    ]
    rows.append(_row("all", drivers, np.ones(len(style), bool), plain, seed=seed, draws=draws))
    if wanted is not None and weights is not None:
        weight = np.array([weights.get(name, 0.0) for name in drivers.style])
        rows.append(_row(f"as {wanted.name}", drivers, weight > 0, weight, seed=seed, draws=draws))
    about = {
        "corpus": {"name": corpus.path.name, "fingerprint": corpus.fingerprint, "seed": corpus.manifest.get("seed")},
        "as_population": None if wanted is None else {"name": wanted.name, "shares": wanted.by_class},
        "weights": weights,
        "bootstrap": {"seed": seed, "draws": draws},
    }
    return Criticality(by, tuple(rows), dict(sorted(table.counts.items())), about, drivers)


def _row(
    name: str,
    drivers: DriverCriticality,
    chosen: Bool[np.ndarray, " driver"],
    weight: Float64[np.ndarray, " driver"],
    *,
    seed: int,
    draws: int,
) -> StyleCriticality:
    unit = np.array(drivers.unit, dtype=object)
    measures = {}
    for title, (column, share) in MEASURES.items():
        value = getattr(drivers, column)
        use = chosen & np.isfinite(value)
        measures[title] = quantile_estimate(
            value[use], weight[use], unit[use].tolist(), share, seed=seed, purpose=f"{name} {title}", draws=draws
        )
    km = drivers.km[chosen] / PER_KM
    rates = {event: event_rate(getattr(drivers, event)[chosen], km, weight[chosen]) for event in EVENTS}
    return StyleCriticality(name, int(chosen.sum()), float(drivers.km[chosen].sum()), measures, rates)


def quantile_estimate(
    value: Float64[np.ndarray, " driver"],
    weight: Float64[np.ndarray, " driver"],
    unit: Sequence[str],
    share: float,
    *,
    seed: int,
    purpose: str,
    draws: int = DRAWS,
) -> Estimate:
    """The weighted quantile over drivers, with the interval of units, then drivers, resampled.

    Refused under 30 drivers; "within site" with fewer than 3 units (`intervals`).
    """
    names, group = np.unique(np.asarray(unit, dtype=str), return_inverse=True)
    n = len(value)
    status = status_of(n, len(names))
    if status == "too few":
        return Estimate(np.nan, np.nan, np.nan, n, len(names), status)
    order = np.argsort(value, kind="stable")
    ascending, heavy = value[order], weight[order]
    groups = (group if status == "general" else np.zeros(n)).astype(np.int64)[order]
    rng = stream(seed, 0, "", f"criticality {purpose}")
    drawn = np.concatenate(
        [_quantile(ascending, resample * heavy, share) for resample in bootstrap_weights(groups, rng, draws)]
    )
    tail = 100 * (1.0 - LEVEL) / 2
    low, high = np.percentile(drawn, [tail, 100 - tail])
    return Estimate(float(_quantile(ascending, heavy[None], share)[0]), float(low), float(high), n, len(names), status)


def _quantile(
    ascending: Float64[np.ndarray, " driver"], weight: Float64[np.ndarray, "draw driver"], share: float
) -> Float64[np.ndarray, " draw"]:
    """The least value that has `share` of each row's weight at or below it (numpy's "inverted_cdf")."""
    below = np.cumsum(weight, axis=1)
    place = (below < share * below[:, -1:] - 1e-12).sum(axis=1)
    return ascending[np.minimum(place, len(ascending) - 1)]
