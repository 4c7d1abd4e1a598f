"""Commanded against measured in one group of drivers: confusion matrix and what is computed from it, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.evaluation import agreement as stats
from stylesim.evaluation.intervals import LEVEL, Estimate, bootstrap_weights, status_of
from stylesim.labels import UNDETERMINED, StyleLabels
from stylesim.randomness import stream
from stylesim.style import STYLE_CLASSES

DRAWS = 1000  # chosen, because the ends of a 95 % interval then rest on 25 draws each; a table has dozens of them
TITLES = {
    "balanced_accuracy": "balanced accuracy",
    "kappa": "κ, quadratic",
    "class_rank": "ρ of class ranks",
    "class_to_a": "ρ class rank, a",
    "class_to_a_ceiling": "ρ ceiling",
    "knob_to_a": "ρ knob, a",
}


@dataclass(frozen=True, eq=False)
class Measured:
    """What one labeller made of every judged driver.

    `share` [driver class] is the share of his windows in each class (whole trips: one class); all 0 where undetermined.
    `a` is the measured aggressiveness (mean of his windows), NaN where undetermined.
    """

    method: str
    reference: str
    span: str  # "track" (whole trips) or "window" (11 s windows)
    classes: tuple[str, ...]
    share: Float64[np.ndarray, "driver measured"]
    a: Float64[np.ndarray, " driver"]

    @property
    def determined(self) -> Bool[np.ndarray, " driver"]:
        """True where there is a class."""
        return np.asarray(self.share.sum(axis=1) > 0)


def measured_tracks(labels: StyleLabels, *, reference: str, transposed: bool = False) -> Measured:
    """One class per driver."""
    owner = np.arange(len(labels))
    return measured_windows(labels, owner, len(labels), reference=reference, transposed=transposed, span="track")


def measured_windows(
    labels: StyleLabels,
    owner: Int64[np.ndarray, " row"],
    n_drivers: int,
    *,
    reference: str,
    transposed: bool = False,
    span: str = "window",
) -> Measured:
    """Shares of each driver's windows; a driver contributes 1 however many he has (REFERENCE section 8)."""
    style = labels.style_transposed if transposed else labels.style
    if style is None:
        raise ValueError(f"{labels.method} has one orientation")
    known = style != UNDETERMINED
    share = np.zeros((n_drivers, len(labels.classes)))
    np.add.at(share, (owner[known], style[known].astype(np.int64)), 1.0)
    share /= np.maximum(share.sum(axis=1, keepdims=True), 1.0)
    value = labels.aggressiveness.astype(np.float64)
    seen = np.isfinite(value) & known
    count = np.bincount(owner[seen], minlength=n_drivers)
    total = np.bincount(owner[seen], weights=value[seen], minlength=n_drivers)
    method = f"{labels.method}_transposed" if transposed else labels.method
    a = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return Measured(method, reference, span, tuple(labels.classes), share, a)


@dataclass(frozen=True, eq=False)
class Agreement:
    """Figures of one group of drivers, by one labeller, on whole trips or windows.

    `count` [commanded measured] are drivers (fractions where a driver's windows differ). `estimates` are named as in
    TITLES for the six classes; where the labeller has others (KDSC), the share of its first class per commanded class.
    `class_to_a` is the rank correlation of commanded class and measured a, its `_ceiling` the same were every driver
    commanded what he measured as: TDBM's classes are not in the order of a.
    """

    group: str
    method: str
    reference: str
    span: str
    measured: tuple[str, ...]
    count: Float64[np.ndarray, "commanded measured"]
    estimates: Mapping[str, Estimate]
    n_units: int

    @property
    def n_drivers(self) -> int:
        """Drivers with a class."""
        return round(float(self.count.sum()))

    @property
    def per_class(self) -> tuple[int, ...]:
        """Drivers of each commanded class."""
        return tuple(round(float(n)) for n in self.count.sum(axis=1))

    @property
    def classes_present(self) -> int:
        """How many classes at least one driver (or most of one's windows) measured as."""
        return int((self.count.sum(axis=0) >= 0.5).sum())

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "group": self.group,
            "method": self.method,
            "reference": self.reference,
            "span": self.span,
            "n_drivers": self.n_drivers,
            "n_units": self.n_units,
            "commanded": list(STYLE_CLASSES),
            "measured": list(self.measured),
            "count": self.count.round(4).tolist(),
            "classes_present": self.classes_present,
            "estimates": {name: value.to_dict() for name, value in self.estimates.items()},
        }


def _six_classes(
    weight: Float64[np.ndarray, "draw driver"],
    commanded: Int64[np.ndarray, " driver"],
    knob: Float64[np.ndarray, " driver"],
    found: Measured,
) -> dict[str, Float64[np.ndarray, " draw"]]:
    count = stats.confusion(weight, commanded, found.share)
    asked = stats.class_rank(commanded)
    mean_rank = found.share @ stats.class_rank(np.arange(len(STYLE_CLASSES)))
    return {
        "balanced_accuracy": stats.balanced_accuracy(count),
        "kappa": stats.quadratic_kappa(count),
        "class_rank": stats.spearman(weight, asked, mean_rank),
        "class_to_a": stats.spearman(weight, asked, found.a),
        "class_to_a_ceiling": stats.spearman(weight, mean_rank, found.a),
        "knob_to_a": stats.spearman(weight, knob, found.a),
    }


def _other_classes(
    weight: Float64[np.ndarray, "draw driver"],
    commanded: Int64[np.ndarray, " driver"],
    knob: Float64[np.ndarray, " driver"],
    found: Measured,
) -> dict[str, Float64[np.ndarray, " draw"]]:
    count = stats.confusion(weight, commanded, found.share)
    total = count.sum(axis=2)
    share = count[:, :, 0] / np.where(total > 0, total, np.nan)
    named = {f"{found.classes[0]}|{name}": share[:, i] for i, name in enumerate(STYLE_CLASSES)}
    return {**named, "knob_to_a": stats.spearman(weight, knob, found.a)}


def agreement_of(
    group: str,
    commanded: Int64[np.ndarray, " driver"],
    knob: Float64[np.ndarray, " driver"],
    unit: Sequence[str],
    found: Measured,
    chosen: Bool[np.ndarray, " driver"],
    *,
    seed: int = 0,
    draws: int = DRAWS,
) -> Agreement:
    """The figures of the chosen drivers that have a class; refused cells (under 30 drivers) hold NaN.

    Intervals: percentile bootstrap of units, then drivers; with fewer than 3 units of drivers only ("within site").
    """
    use = chosen & found.determined & np.isfinite(found.a)
    part = Measured(found.method, found.reference, found.span, found.classes, found.share[use], found.a[use])
    own_commanded, own_knob = commanded[use], knob[use]
    names, of_unit = np.unique(np.asarray(unit, dtype=str)[use], return_inverse=True)
    n = int(use.sum())
    status = status_of(n, len(names))
    figures = _six_classes if found.classes == STYLE_CLASSES else _other_classes
    whole = np.ones((1, n))
    estimates: dict[str, Estimate] = {}
    if status == "too few":
        for name in figures(whole, own_commanded, own_knob, part) if n else ():
            estimates[name] = Estimate(np.nan, np.nan, np.nan, n, len(names), status)
    else:
        point = figures(whole, own_commanded, own_knob, part)
        groups = (of_unit if status == "general" else np.zeros(n)).astype(np.int64)
        rng = stream(seed, 0, "", f"fidelity {group} {found.method} {found.reference} {found.span}")
        drawn = [figures(w, own_commanded, own_knob, part) for w in bootstrap_weights(groups, rng, draws)]
        for name, value in point.items():
            low, high = _ends(np.concatenate([one[name] for one in drawn]))
            estimates[name] = Estimate(float(value[0]), low, high, n, len(names), status)
    count = stats.confusion(whole, own_commanded, part.share)[0]
    return Agreement(group, found.method, found.reference, found.span, found.classes, count, estimates, len(names))


def _ends(drawn: Float64[np.ndarray, " draw"]) -> tuple[float, float]:
    """Both ends of the interval; NaN where no resample knows the figure."""
    known = drawn[np.isfinite(drawn)]
    if not len(known):
        return float("nan"), float("nan")
    tail = 100 * (1.0 - LEVEL) / 2
    low, high = np.percentile(known, [tail, 100 - tail])
    return float(low), float(high)
