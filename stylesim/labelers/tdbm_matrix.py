"""TDBM's matrix, its two readings, and the weights of the measured aggressiveness."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from stylesim.style import CLASS_KNOB, STYLE_CLASSES

# Cheung et al. 2018, as printed there [paper]. Rows: STYLE_CLASSES; columns: s_center, v_nei, s_front, v_avg, j_l, 1.
MATRIX = np.array(
    [
        [1.63, 4.04, -0.46, -0.82, 0.88, -2.58],
        [1.58, 3.08, -0.45, 0.02, -0.10, -1.67],
        [1.35, 4.08, -0.58, -0.43, -0.28, -1.99],
        [-1.51, -3.17, 1.06, 0.51, -0.51, 1.39],
        [-2.47, -2.60, 1.43, 0.98, -0.82, 1.27],
        [-3.59, -2.19, 1.75, 1.73, -0.30, 0.61],
    ]
)
MATRIX.flags.writeable = False

# "printed": s = B x, the default. "transposed": s = B^T x, which reproduces the paper's statements [computed].
ORIENTATIONS = ("printed", "transposed")

# a = w . s: the places of the classes on the knob as weights of their scores [ours, REFERENCE section 1].
AGGRESSIVENESS_WEIGHTS = np.array([CLASS_KNOB[name] for name in STYLE_CLASSES])
AGGRESSIVENESS_WEIGHTS.flags.writeable = False


def scores(scaled: Float64[np.ndarray, "row 5"], orientation: str = "printed") -> Float64[np.ndarray, "row 6"]:
    """The six scores of features on [0, 1], in the order of STYLE_CLASSES; NaN where a feature is.

    Summed term by term rather than by a matrix product, so that a row's bits do not depend on the rows around it.
    """
    matrix = MATRIX if orientation == "printed" else MATRIX.T
    result = np.repeat(matrix[None, :, 5], len(scaled), axis=0)
    for i in range(5):
        result = result + scaled[:, i : i + 1] * matrix[None, :, i]
    return result


def aggressiveness(score: Float64[np.ndarray, "row 6"]) -> Float64[np.ndarray, " row"]:
    """A = w . s of printed scores; linear, so a larger gap never raises it."""
    result = np.zeros(len(score))
    for i, weight in enumerate(AGGRESSIVENESS_WEIGHTS):
        result = result + weight * score[:, i]
    return result
