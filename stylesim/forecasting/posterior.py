"""`StylePosterior`: how likely each style is, given what a history shows; learned from whole tracks. No torch.

The class of the whole track (or the commanded one) is a target here, never an input: REFERENCE section 4 allows labels
that saw the future for a head pi(z | history), and then sum_z pi(z | x) p(y | x, z).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.errors import InputError
from stylesim.forecasting.measured import Measured
from stylesim.forecasting.vectors import StyleVectors
from stylesim.labels import UNDETERMINED

MOST_SAMPLES = 20_000  # chosen: a few seconds of fitting; more changes the coefficients in the third digit at most
REGULARISATION = 1.0  # scikit-learn's default C, on standardised columns
MOST_ITERATIONS = 1000


@dataclass(frozen=True, eq=False)
class StylePosterior:
    """A multinomial logistic regression on the raw features of TDBM and KDSC.

    Who shows no feature gets the frequencies of the classes in training; a class that nobody had there gets 0.
    """

    vectors: StyleVectors
    weight: Float64[np.ndarray, "style column"]
    bias: Float64[np.ndarray, " style"]  # -inf for a class that nobody had
    frequency: Float64[np.ndarray, " style"]

    @classmethod
    def fit(
        cls,
        training: Measured,
        target: Int64[np.ndarray, " row"],
        classes: Sequence[str],
        *,
        rng: np.random.Generator,
    ) -> StylePosterior | None:
        """Fitted on the training samples whose true class is known; None where there is nothing to learn from."""
        rows = np.flatnonzero(target != UNDETERMINED)
        if not np.isfinite(training.evidence[rows]).any():
            return None
        if len(rows) > MOST_SAMPLES:
            rows = np.sort(rng.choice(rows, MOST_SAMPLES, replace=False))
        told = training.rows(np.isin(np.arange(len(target)), rows))
        target = target[rows]
        frequency = np.bincount(target, minlength=len(classes)) / len(target)
        vectors = StyleVectors.fit(told, classes, form="features")
        column: Float64[np.ndarray, "row column"] = vectors.assign(told).astype(np.float64)
        seen = np.isfinite(column).all(axis=1)
        weight, bias = np.zeros((len(classes), column.shape[1])), np.zeros(len(classes))
        bias[frequency == 0] = -np.inf
        if len(np.unique(target[seen])) > 1:
            found, coefficients, intercepts = _regression(column[seen], target[seen])
            bias[:] = -np.inf
            weight[found], bias[found] = coefficients, intercepts
        return cls(vectors, weight, bias, frequency)

    def of(self, measured: Measured) -> Float64[np.ndarray, "row style"]:
        """The probabilities of the classes; rows sum to 1."""
        column: Float64[np.ndarray, "row column"] = self.vectors.assign(measured).astype(np.float64)
        seen = np.isfinite(column).all(axis=1)
        logit = np.where(seen[:, None], column, 0.0) @ self.weight.T + self.bias
        chance = np.exp(logit - logit.max(axis=1, keepdims=True))
        return np.where(seen[:, None], chance / chance.sum(axis=1, keepdims=True), self.frequency)

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {
            "vectors": self.vectors.to_dict(),
            "weight": self.weight.tolist(),
            "bias": [None if np.isneginf(b) else b for b in self.bias.tolist()],
            "frequency": self.frequency.tolist(),
        }

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> StylePosterior:
        """The inverse of `to_dict`."""
        return cls(
            StyleVectors.from_dict(raw["vectors"]),
            np.asarray(raw["weight"], np.float64),
            np.array([-np.inf if b is None else b for b in raw["bias"]], np.float64),
            np.asarray(raw["frequency"], np.float64),
        )


def _regression(
    column: Float64[np.ndarray, "row column"], target: Int64[np.ndarray, " row"]
) -> tuple[Int64[np.ndarray, " found"], Float64[np.ndarray, "found column"], Float64[np.ndarray, " found"]]:
    """The classes found, and their coefficients and intercepts."""
    from sklearn.linear_model import LogisticRegression

    model = LogisticRegression(C=REGULARISATION, max_iter=MOST_ITERATIONS).fit(column, target)
    if model.n_iter_.max() >= MOST_ITERATIONS:
        raise InputError(
            f"the style posterior did not settle in {MOST_ITERATIONS} steps on {len(target)} samples; look at the "
            "features for values that are far out (`stylesim verify`)"
        )
    found = model.classes_.astype(np.int64)
    if len(found) == 2:  # one row of coefficients, those of the second class against the first
        half = model.coef_[0] / 2, model.intercept_[0] / 2
        return found, np.stack([-half[0], half[0]]), np.array([-half[1], half[1]])
    return found, model.coef_, model.intercept_
