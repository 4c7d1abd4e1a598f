"""Quaternions (w, x, y, z) as rotation matrices, and the heading that a rotation has on the ground."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64


def rotation_of(quaternion: Float64[np.ndarray, "row 4"]) -> Float64[np.ndarray, "row 3 3"]:
    """Rotation matrices of quaternions of any length; not-a-number where one has the length 0."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        w, x, y, z = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), 2, 0)


def heading_of(rotation: Float64[np.ndarray, "row 3 3"]) -> Float64[np.ndarray, " row"]:
    """Counter-clockwise angle from x of where the rotated x axis points."""
    return np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
