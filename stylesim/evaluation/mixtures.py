"""How well the probabilities of modes fit a mixture of futures: the energy score of the final position.

Gneiting and Raftery 2007 [recalled]: for a forecast F and the outcome y, E|X - y| - E|X - X'| / 2 with X, X' drawn from
F independently. It is strictly proper, in metres, the lower the better, and for one mode it is the final displacement.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.optimize import minimize


def energy_score(
    end_m: Float64[np.ndarray, "mode 2"], probability: Float64[np.ndarray, " mode"], truth_m: Float64[np.ndarray, "n 2"]
) -> float:
    """Mean over the outcomes, metres: outcomes count alike, so two of them are an equal mixture of both."""
    to_truth, apart = _distances(end_m, truth_m)
    return float(probability @ to_truth - probability @ apart @ probability / 2)


def best_weights(
    end_m: Float64[np.ndarray, "mode 2"], truth_m: Float64[np.ndarray, "n 2"]
) -> Float64[np.ndarray, " mode"]:
    """The probabilities that these modes should have had for this mixture: the least energy score there is.

    Distances are conditionally negative definite, so the score is convex on the simplex and has one least value.
    """
    to_truth, apart = _distances(end_m, truth_m)
    modes = len(end_m)
    if modes == 1:
        return np.ones(1)
    found = minimize(
        lambda p: p @ to_truth - p @ apart @ p / 2,
        np.full(modes, 1.0 / modes),
        jac=lambda p: to_truth - apart @ p,
        bounds=[(0.0, 1.0)] * modes,
        constraints={"type": "eq", "fun": lambda p: p.sum() - 1.0, "jac": lambda p: np.ones(modes)},
        method="SLSQP",
        options={"maxiter": 200, "ftol": 1e-10},
    )
    weights = np.clip(found.x, 0.0, None)
    return np.asarray(weights / weights.sum())


def _distances(
    end_m: Float64[np.ndarray, "mode 2"], truth_m: Float64[np.ndarray, "n 2"]
) -> tuple[Float64[np.ndarray, " mode"], Float64[np.ndarray, "mode mode"]]:
    """From each mode to the outcomes (their mean), and between modes."""
    to_truth = np.linalg.norm(end_m[:, None] - truth_m[None], axis=2).mean(axis=1)
    return to_truth, np.linalg.norm(end_m[:, None] - end_m[None], axis=2)
