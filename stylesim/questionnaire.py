"""Answers of drivers to a questionnaire, as scenes carry them: `mdsi_07@P3` in `Scene.parameters` is item 7 of P3.

The multidimensional driving style inventory has 44 items, answered from 1 (not at all) to 6 (very much).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64

from stylesim.errors import InputError

N_ITEMS = 44
LOWEST, HIGHEST = 1, 6


def answer_key(item: int, participant: str) -> str:
    """The name under which a scene carries a participant's answer to an item (1 to 44)."""
    return f"mdsi_{item:02d}@{participant}"


def answers_of(parameters: Mapping[str, float], participant: str) -> Float64[np.ndarray, " item"] | None:
    """A participant's 44 answers, NaN where one is missing; None where the scene carries none of his."""
    found = np.array([parameters.get(answer_key(i + 1, participant), np.nan) for i in range(N_ITEMS)])
    return None if np.isnan(found).all() else found


def checked_answers(answers: Float64[np.ndarray, " item"], *, where: str) -> Float64[np.ndarray, " item"]:
    """The answers, if there are 44 and each is a whole number from 1 to 6 or NaN; InputError naming the item."""
    array = np.asarray(answers, np.float64)
    if array.shape != (N_ITEMS,):
        raise InputError(f"{where}: {array.size} answers; the inventory has {N_ITEMS} items")
    for item, value in enumerate(array.tolist(), start=1):
        if not (np.isnan(value) or (LOWEST <= value <= HIGHEST and value == round(value))):
            raise InputError(
                f"{where}: the answer to item {item} is {value:g}; expected {LOWEST} to {HIGHEST}, or none"
            )
    return array
