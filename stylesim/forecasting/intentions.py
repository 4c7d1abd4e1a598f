"""Intentions: the mean accelerations that futures fall into, by k-means over the training split. No torch."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32, Int64

# Chosen: standing, then bands of 4 m/s to 16 m/s (city) and 8 m/s beyond (rural, motorway). Within one band the
# same acceleration means the same manoeuvre; over all speeds it does not.
SPEED_EDGES_MPS = (0.5, 4.0, 8.0, 12.0, 16.0, 24.0)
LEAST_PER_QUERY = 2  # a band with fewer samples per query than this takes the intentions of all bands
ITERATIONS = 50


def kmeans(
    points: Float[np.ndarray, "point feature"], count: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "cluster feature"], Int64[np.ndarray, " point"]]:
    """Lloyd's algorithm from a k-means++ start: (centres, cluster of each point).

    Written out, since results must not depend on the number of threads. With fewer distinct points than clusters
    some centres coincide. ValueError without points.
    """
    if not len(points):
        raise ValueError("k-means needs at least one point")
    x = points.astype(np.float64)
    centres = x[[int(rng.integers(len(x)))]]
    for _ in range(count - 1):
        squared = nearest_centre(x, centres)[1]
        total = squared.sum()
        chosen = rng.choice(len(x), p=squared / total) if total > 0 else rng.integers(len(x))
        centres = np.concatenate([centres, x[[int(chosen)]]])
    cluster = nearest_centre(x, centres)[0]
    for _ in range(ITERATIONS):
        size = np.bincount(cluster, minlength=count)
        total_by = np.stack([np.bincount(cluster, weights=column, minlength=count) for column in x.T], axis=1)
        centres = np.where(size[:, None] > 0, total_by / np.maximum(size, 1)[:, None], centres)
        moved = nearest_centre(x, centres)[0]
        if np.array_equal(moved, cluster):
            break
        cluster = moved
    return centres, cluster


def nearest_centre(
    points: Float[np.ndarray, "point feature"], centres: Float[np.ndarray, "cluster feature"]
) -> tuple[Int64[np.ndarray, " point"], Float[np.ndarray, " point"]]:
    """The nearest centre of each point, and its squared distance."""
    squared = np.stack([((points - centre) ** 2).sum(axis=1) for centre in centres], axis=1)
    cluster = squared.argmin(axis=1)
    return cluster, squared[np.arange(len(points)), cluster]


def speed_group(speed_mps: Float[np.ndarray, " sample"]) -> Int64[np.ndarray, " sample"]:
    """The band of each speed."""
    return np.searchsorted(np.array(SPEED_EDGES_MPS, np.float32), speed_mps, side="right")


def intentions(
    velocity_mps: Float32[np.ndarray, "sample 2"],
    end_m: Float32[np.ndarray, "sample 2"],
    *,
    horizon_s: float,
    queries: int,
    rng: np.random.Generator,
) -> Float32[np.ndarray, "band query 2"]:
    """For each band of speed, the `queries` mean accelerations that the ends of the futures fall into.

    Velocities and ends are in each sample's own frame. The mean acceleration is the one that, kept over the
    horizon, leads from the velocity of t0 to the end.
    """
    acceleration = 2.0 * (end_m.astype(np.float64) - velocity_mps * horizon_s) / horizon_s**2
    band = speed_group(np.hypot(velocity_mps[:, 0], velocity_mps[:, 1]))
    everyone, _ = kmeans(acceleration, queries, rng)
    result = np.tile(everyone, (len(SPEED_EDGES_MPS) + 1, 1, 1))
    for number in range(len(result)):
        inside = acceleration[band == number]
        if len(inside) >= LEAST_PER_QUERY * queries:
            result[number], _ = kmeans(inside, queries, rng)
    return result.astype(np.float32)
