"""The key of the multidimensional driving style inventory: which items make which factor, and which are reversed.

Taubman-Ben-Ari, Mikulincer and Gillath 2004, 44 items. The key is docs/REFERENCE.md, section 3 [recalled, partition of
1 to 44 checked]; the wording of the items is copyrighted and not here.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from stylesim.questionnaire import HIGHEST, LOWEST

# Items of each factor; negative: reversed, that is 7 - x.
FACTORS: dict[str, tuple[int, ...]] = {
    "dissociative": (11, 15, 27, 30, 34, 35, 36, 39),
    "anxious": (-4, 7, 10, 25, 31, 33, -40),
    "risky": (6, 20, 22, 24, 44),
    "angry": (3, 12, 19, 28, 43),
    "high_velocity": (2, 5, 9, 16, 17, 32),
    "distress_reduction": (1, 8, 26, 37),
    "patient": (13, 18, 23, 38),
    "careful": (14, -21, -29, 41, 42),
}
# The four broad styles and their factors [read: 11, 19, 5 and 9 items].
STYLES: dict[str, tuple[str, ...]] = {
    "reckless_careless": ("risky", "high_velocity"),
    "anxious": ("anxious", "dissociative", "distress_reduction"),
    "angry_hostile": ("angry",),
    "patient_careful": ("patient", "careful"),
}


def keyed(answers: Float64[np.ndarray, "driver item"]) -> Float64[np.ndarray, "driver item"]:
    """The answers with the reversed items turned round."""
    turned = np.array(answers, np.float64)
    for items in FACTORS.values():
        for item in items:
            if item < 0:
                turned[:, -item - 1] = LOWEST + HIGHEST - turned[:, -item - 1]
    return turned


def means(
    answers: Float64[np.ndarray, "driver item"], items: tuple[int, ...], least_share: float
) -> Float64[np.ndarray, " driver"]:
    """The mean of the items that were answered, the reversed ones turned; NaN below `least_share` of them."""
    chosen = keyed(answers)[:, [abs(item) - 1 for item in items]]
    there = np.isfinite(chosen)
    total = np.where(there, chosen, 0.0).sum(axis=1)
    count = there.sum(axis=1)
    enough = (count >= least_share * len(items)) & (count > 0)
    return np.where(enough, total / np.maximum(count, 1), np.nan)


def factor_scores(
    answers: Float64[np.ndarray, "driver item"], least_share: float
) -> Float64[np.ndarray, "driver factor"]:
    """The eight factors of each driver, in the order of FACTORS."""
    return np.stack([means(answers, items, least_share) for items in FACTORS.values()], axis=1)


def style_scores(
    answers: Float64[np.ndarray, "driver item"], least_share: float
) -> Float64[np.ndarray, "driver style"]:
    """The four broad styles of each driver: the mean over the items of all their factors, in the order of STYLES."""
    items = [tuple(i for factor in factors for i in FACTORS[factor]) for factors in STYLES.values()]
    return np.stack([means(answers, chosen, least_share) for chosen in items], axis=1)
