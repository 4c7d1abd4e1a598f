"""Statistics against known answers and other people's implementations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import mannwhitneyu
from sklearn.metrics import cohen_kappa_score

from stylesim.evaluation.analysis.statistics import between_groups_p, cliffs_delta, holm, icc1, kappa, resampled


@given(st.lists(st.integers(0, 5), min_size=2, max_size=30), st.integers(1, 29))
def test_cliffs_delta_is_mann_whitneys_u(values, cut):
    value = np.array(values, float)
    first = np.arange(len(value)) < min(cut, len(value) - 1)
    u = mannwhitneyu(value[first], value[~first]).statistic
    expected = 2 * u / (first.sum() * (~first).sum()) - 1
    found = cliffs_delta(first[None].astype(float), (~first)[None].astype(float), value)
    assert found[0] == pytest.approx(expected, abs=1e-12)


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_icc_of_shrout_and_fleiss():
    """Their table of 6 targets and 4 judges gives ICC(1) = 0.17."""
    table = np.array([[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]], float)
    found = icc1(np.ones((1, 6)), np.full(6, 4.0), table.sum(axis=1), (table**2).sum(axis=1))
    assert found[0] == pytest.approx(0.17, abs=0.005)


def test_kappa_is_scikit_learns():
    rng = np.random.default_rng(1)
    a, b = rng.integers(0, 3, 200), rng.integers(0, 3, 200)
    b[:100] = a[:100]
    table = np.zeros((1, 3, 3))
    np.add.at(table[0], (a, b), 1)
    assert kappa(table)[0] == pytest.approx(cohen_kappa_score(a, b))


def test_permutation_finds_a_difference_within_scenes_and_no_difference_between_them():
    rng = np.random.default_rng(2)
    scene = np.repeat(np.arange(10), 20)
    group = rng.integers(0, 2, 200)
    noise = rng.normal(size=200)
    by_scene = noise + scene  # scenes differ, and groups come in other shares in each
    mixed = (rng.random(200) < scene / 10).astype(np.int64)
    value = np.stack([noise + group, by_scene], axis=1)
    assert between_groups_p(value, group, scene, seed=0, purpose="a")[0] < 0.01
    assert mannwhitneyu(by_scene[mixed == 1], by_scene[mixed == 0]).pvalue < 0.001
    assert between_groups_p(value, mixed, scene, seed=0, purpose="b")[1] > 0.05


def test_too_few_drivers_are_refused():
    found = resampled(lambda w: w.mean(axis=1), ["a"] * 29, seed=0, purpose="x")
    assert found.refused and np.isnan(found.value)
