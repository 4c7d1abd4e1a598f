from __future__ import annotations

import numpy as np
import pytest
from sklearn.cluster import KMeans
from sklearn.mixture import GaussianMixture

from stylesim.errors import InputError
from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.tdbm import TDBM
from stylesim.scene import Scene

from .made import clock, lanes, scene_of, traffic


def calm_and_rough(name: str = "two kinds", *, calm: int = 24, rough: int = 12, seed: int = 0) -> Scene:
    rng = np.random.default_rng(seed)
    t = clock(230)
    paths = []
    for i in range(calm + rough):
        strength = rng.uniform(0.1, 0.4) if i < calm else rng.uniform(2.0, 3.0)
        speed = 10 + strength * np.sin(rng.uniform(0.8, 1.2) * t + rng.uniform(0, 6))
        paths.append(np.stack([20.0 * i + np.cumsum(speed) * 0.1, np.full(230, 3.5 * (i % 2))], axis=1))
    return scene_of(paths, road=lanes(), name=name)


@pytest.mark.parametrize(
    "clusterer",
    [None, KMeans(2, n_init=3, random_state=0), GaussianMixture(2, random_state=0)],
    ids=["ward", "kmeans", "mixture"],
)
def test_rough_drivers_are_called_aggressive(clusterer: object) -> None:
    kdsc = KDSC(clusterer=clusterer).fit([calm_and_rough()])
    found = kdsc.label_windows(calm_and_rough(seed=5))
    assert [found.class_name(i) for i in range(len(found))] == ["normal"] * 24 + ["aggressive"] * 12
    assert kdsc.agreement_ >= 0.95
    assert kdsc.track_model_.size == (12, 24)
    assert (found.aggressiveness[24:] > found.aggressiveness[:24].max()).all()
    history = kdsc.label_windows(calm_and_rough(seed=6), [30], 50, span="history")
    assert np.mean(history.style == ([1] * 24 + [0] * 12)) > 0.9


def test_gamma_is_the_sd_of_jerk_over_the_reference_mean() -> None:
    kdsc = KDSC().fit([calm_and_rough()])
    found = kdsc.label_windows(calm_and_rough())
    names = found.feature_names
    scale = kdsc.track_model_.jerk_scale_mps3[0]
    jerk = TDBM().fit([traffic()]).label_windows(calm_and_rough()).feature[:, 4]
    assert scale == pytest.approx(jerk.mean(), rel=1e-4)
    gamma, variance = (found.feature[:, names.index(name)] for name in ("gamma", "var_jerk"))
    np.testing.assert_allclose((gamma * scale) ** 2, variance, rtol=0.02)  # two windows: mean of roots, root of mean


def test_another_number_of_clusters_needs_as_many_names() -> None:
    with pytest.raises(InputError, match="found 3 clusters for 2 names"):
        KDSC(clusterer=KMeans(3, n_init=1, random_state=0)).fit([calm_and_rough()])
    three = KDSC(names=("rough", "middling", "calm")).fit([calm_and_rough()])
    assert three.label_windows(calm_and_rough()).classes == ("rough", "middling", "calm")


def test_too_few_drivers_are_refused() -> None:
    with pytest.raises(InputError, match="3 drivers have a full window of 11 s, 4 are needed"):
        KDSC().fit([traffic(agents=3)])
