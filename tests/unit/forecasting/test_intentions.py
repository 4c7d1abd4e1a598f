from __future__ import annotations

import numpy as np
import pytest

from stylesim.forecasting.intentions import SPEED_EDGES_MPS, intentions, kmeans


def test_kmeans_finds_separate_groups() -> None:
    rng = np.random.default_rng(0)
    truth = np.array([[0, 0], [10, 0], [0, 10]])
    points = np.repeat(truth, 50, axis=0) + rng.normal(0, 0.1, (150, 2))
    centre, cluster = kmeans(points, 3, np.random.default_rng(1))
    assert sorted(np.round(centre).tolist()) == sorted(truth.tolist())
    assert len({tuple(cluster[i : i + 50]) for i in (0, 50, 100)}) == 3


def test_kmeans_with_fewer_points_than_clusters_stays_finite() -> None:
    centre, cluster = kmeans(np.array([[1.0, 1.0], [1.0, 1.0]]), 4, np.random.default_rng(0))
    np.testing.assert_array_equal(centre, np.ones((4, 2)))
    assert cluster.tolist() == [0, 0]
    with pytest.raises(ValueError, match="at least one point"):
        kmeans(np.zeros((0, 2)), 2, np.random.default_rng(0))


def test_intentions_are_mean_accelerations_per_band_of_speed() -> None:
    rng = np.random.default_rng(0)
    speed = np.repeat([6.0, 30.0], 100)
    acceleration = np.where(np.arange(200) % 2 == 0, -2.0, 1.0)
    velocity = np.stack([speed, np.zeros(200)], axis=1).astype(np.float32)
    end = (velocity * 4.0 + 0.5 * np.stack([acceleration, np.zeros(200)], axis=1) * 16.0).astype(np.float32)
    found = intentions(velocity, end, horizon_s=4.0, queries=2, rng=rng)
    assert found.shape == (len(SPEED_EDGES_MPS) + 1, 2, 2)
    for band in range(len(found)):
        np.testing.assert_allclose(sorted(found[band, :, 0]), [-2.0, 1.0], atol=1e-3)
