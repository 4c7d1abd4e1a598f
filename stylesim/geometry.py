"""Plane geometry on arrays: angles, polylines, boxes."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int


def wrap_angle(angle_rad: Float[np.ndarray, "*any"]) -> Float[np.ndarray, "*any"]:
    """The same angles in [-pi, pi)."""
    turned = np.asarray(angle_rad + np.pi)
    beyond = (turned < 0) | (turned >= 2 * np.pi)
    if beyond.any():  # of the others the remainder is what they are, and it costs more than all else here
        turned[beyond] = np.remainder(turned[beyond], 2 * np.pi)
    return np.asarray(turned - np.pi)


def rotated(points: Float[np.ndarray, "*any 2"], angle_rad: float) -> Float[np.ndarray, "*any 2"]:
    """`points` turned counter-clockwise about the origin."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def arc_length(line_m: Float[np.ndarray, "point 2"]) -> Float[np.ndarray, " point"]:
    """Distance along the polyline at each of its points, from 0."""
    step = np.hypot(*np.diff(line_m.astype(np.float64), axis=0).T)
    return np.concatenate([[0.0], np.cumsum(step)])


def project(
    points_m: Float[np.ndarray, "query 2"], line_m: Float[np.ndarray, "point 2"]
) -> tuple[
    Float[np.ndarray, " query"], Float[np.ndarray, " query"], Float[np.ndarray, " query"], Int[np.ndarray, " query"]
]:
    """The nearest place on a polyline for each point.

    Returns (along, offset, distance, segment): arc length of the foot point, signed lateral offset (left of the
    direction of travel is positive), distance to the foot point (> |offset| beyond the ends), segment index.
    """
    line = line_m.astype(np.float64)
    a, ab = line[:-1], np.diff(line, axis=0)
    length = np.hypot(ab[:, 0], ab[:, 1])
    points = points_m.astype(np.float64)  # x and y apart: a sum over an axis of two costs four times as much
    apx, apy = points[:, :1] - a[:, 0], points[:, 1:] - a[:, 1]
    t = np.clip((apx * ab[:, 0] + apy * ab[:, 1]) / np.maximum(length**2, 1e-12), 0.0, 1.0)
    squared = (apx - t * ab[:, 0]) ** 2 + (apy - t * ab[:, 1]) ** 2
    segment = squared.argmin(axis=1)
    row = np.arange(len(segment))
    start = np.concatenate([[0.0], np.cumsum(length)])[:-1]
    along = start[segment] + t[row, segment] * length[segment]
    distance = np.sqrt(squared[row, segment])
    cross = ab[segment, 0] * apy[row, segment] - ab[segment, 1] * apx[row, segment]
    offset = cross / np.maximum(length[segment], 1e-12)
    return along, offset, distance, segment


def resampled(line_m: Float[np.ndarray, "point 2"], spacing_m: float) -> Float[np.ndarray, "sample 2"]:
    """The polyline with points about `spacing_m` apart, its ends kept."""
    s = arc_length(line_m)
    n = max(2, int(np.ceil(s[-1] / spacing_m)) + 1)
    at = np.linspace(0.0, s[-1], n)
    return np.stack([np.interp(at, s, line_m[:, 0]), np.interp(at, s, line_m[:, 1])], axis=1)


def box_corners(
    centre_m: Float[np.ndarray, "*any 2"], heading_rad: Float[np.ndarray, "*any"], size_m: Float[np.ndarray, "*any 2"]
) -> Float[np.ndarray, "*any 4 2"]:
    """Corners of oriented boxes: front left, front right, rear right, rear left."""
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    ahead = np.stack([c, s], axis=-1) * size_m[..., :1] / 2
    left = np.stack([-s, c], axis=-1) * size_m[..., 1:] / 2
    return np.stack(
        [centre_m + ahead + left, centre_m + ahead - left, centre_m - ahead - left, centre_m - ahead + left], axis=-2
    )


def boxes_overlap(
    corners_a: Float[np.ndarray, "*pair 4 2"], corners_b: Float[np.ndarray, "*pair 4 2"]
) -> Bool[np.ndarray, "*pair"]:
    """True where two oriented boxes overlap (separating axis theorem); touching is no overlap."""
    overlap = np.ones(np.broadcast_shapes(corners_a.shape[:-2], corners_b.shape[:-2]), bool)
    for corners in (corners_a, corners_b):
        for first, second in ((0, 1), (1, 2)):
            axis = corners[..., second, :] - corners[..., first, :]
            pa = (corners_a * axis[..., None, :]).sum(-1)
            pb = (corners_b * axis[..., None, :]).sum(-1)
            overlap &= (pa.max(-1) > pb.min(-1)) & (pb.max(-1) > pa.min(-1))
    return overlap
