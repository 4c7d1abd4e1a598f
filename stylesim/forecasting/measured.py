"""`Measured`: what fitted labellers say of drivers, before clusters, scalers and networks are known. No torch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.errors import InputError
from stylesim.labels import UNDETERMINED, LabelFlag, StyleLabels

CLUSTER_FEATURES = ("max_abs_acceleration", "var_acceleration", "var_speed", "gamma")  # REFERENCE section 2 [paper]


def _nothing() -> Any:
    return np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class Measured:
    """What the history says of each driver. `score` and `evidence` may have no columns."""

    style: Int64[np.ndarray, " row"]  # UNDETERMINED where unknown
    feature: Float64[np.ndarray, "row 4"]  # CLUSTER_FEATURES; NaN where missing
    highway: Int64[np.ndarray, " row"]  # 0 or 1
    score: Float64[np.ndarray, "row number"] = field(default_factory=_nothing)  # classes first; NaN if unknown
    evidence: Float64[np.ndarray, "row raw"] = field(default_factory=_nothing)  # raw features; NaN where missing

    def __post_init__(self) -> None:
        """Give columns that were left out a row for each driver."""
        for name in ("score", "evidence"):
            if not getattr(self, name).size:
                object.__setattr__(self, name, np.zeros((len(self.style), 0)))

    @classmethod
    def of(cls, style: StyleLabels, kinematic: StyleLabels) -> Measured:
        """Class and scores from one method's labels, features from KDSC's; InputError if a label saw the future."""
        for labels in (style, kinematic):
            if labels.span != "history":
                raise InputError(f"{labels.method} labels of span {labels.span!r} cannot condition; only history can")
        missing = set(CLUSTER_FEATURES) - set(kinematic.feature_names)
        if missing:
            raise InputError(f"{kinematic.method} labels lack the feature(s) {', '.join(sorted(missing))}")
        columns = [kinematic.feature_names.index(name) for name in CLUSTER_FEATURES]
        sources = (kinematic,) if style is kinematic else (style, kinematic)
        return cls(
            style.style.astype(np.int64),
            _features(kinematic)[:, columns],
            ((style.flags & LabelFlag.HIGHWAY) != 0).astype(np.int64),
            _scores(style),
            np.concatenate([_features(labels) for labels in sources], axis=1),
        )

    @classmethod
    def joined(cls, parts: Sequence[Measured]) -> Measured:
        """One after the other."""
        if not parts:
            return cls(np.zeros(0, np.int64), np.zeros((0, len(CLUSTER_FEATURES))), np.zeros(0, np.int64))
        return cls(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)})

    @classmethod
    def averaged(cls, parts: Sequence[Measured], classes: int) -> Measured:
        """The same drivers in several windows, the latest first: means over the windows where they are known.

        The class is the one of the highest mean score, or of most windows where the judges give no scores (the bolder
        one of two as frequent); the context is that of the latest window.
        """
        known = np.stack([part.style != UNDETERMINED for part in parts])  # [window row]
        votes = np.zeros((known.shape[1], classes))
        for part in parts:
            votes += part.style[:, None] == np.arange(classes)
        score = _mean([part.score for part in parts])
        ranked = score[:, :classes] if score.shape[1] >= classes else votes
        best = np.where(np.isfinite(ranked), ranked, -np.inf).argmax(axis=1)
        return cls(
            np.where(known.any(axis=0), best, UNDETERMINED).astype(np.int64),
            _mean([part.feature for part in parts]),
            parts[0].highway,
            score,
            _mean([part.evidence for part in parts]),
        )

    def rows(self, keep: Bool[np.ndarray, " row"]) -> Measured:
        """The rows where `keep` is True."""
        return Measured(**{f.name: getattr(self, f.name)[keep] for f in fields(self)})

    def with_style(self, style: Int64[np.ndarray, " row"]) -> Measured:
        """The same drivers, told to be of these styles."""
        return replace(self, style=style)


def _features(labels: StyleLabels) -> Float64[np.ndarray, "row feature"]:
    return np.where(labels.missing, np.nan, labels.feature).astype(np.float64)


def _scores(labels: StyleLabels) -> Float64[np.ndarray, "row number"]:
    """TDBM: the scores and the measured a. KDSC: the probability of each cluster.

    The probability takes clusters as normal, with unit variance in the standardised features that they were found in,
    and as equally frequent: p proportional to exp(-d^2 / 2), d the distance that is the negative score [ours].
    """
    score = labels.score.astype(np.float64)
    if labels.method == "kdsc":
        log_odds = -0.5 * score**2
        chance = np.exp(log_odds - log_odds.max(axis=1, keepdims=True))
        score = chance / chance.sum(axis=1, keepdims=True)
    else:
        score = np.column_stack([score, labels.aggressiveness.astype(np.float64)])
    return np.where(labels.style[:, None] == UNDETERMINED, np.nan, score)


def _mean(parts: Sequence[Float64[np.ndarray, "row number"]]) -> Float64[np.ndarray, "row number"]:
    """Mean over windows, of the numbers that are known; NaN where none is."""
    stacked = np.stack(parts)
    known = np.isfinite(stacked)
    total = np.where(known, stacked, 0.0).sum(axis=0)
    count = known.sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
