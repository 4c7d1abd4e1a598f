from __future__ import annotations

import numpy as np
import pytest

from stylesim.evaluation.intervals import Estimate, bootstrap_means, estimate, paired_difference, status_of


def units(n_units: int, each: int) -> list[str]:
    return [f"u{i}" for i in range(n_units) for _ in range(each)]


@pytest.mark.parametrize(
    ("drivers", "n_units", "expected"),
    [(29, 29, "too few"), (30, 2, "within site"), (30, 3, "general"), (29, 1, "too few"), (0, 0, "too few")],
)
def test_what_a_cell_may_claim(drivers, n_units, expected):
    assert status_of(drivers, n_units) == expected


def test_the_strict_reading_refuses_a_single_site():
    assert status_of(1000, 2, within_site=False) == "too few"
    assert estimate(np.arange(40.0), units(2, 20), seed=0, purpose="x", within_site=False).refused


def test_a_refused_cell_has_n_and_no_value():
    cell = estimate(np.arange(29.0), units(29, 1), seed=0, purpose="x")
    assert (cell.status, cell.n_drivers, cell.n_units) == ("too few", 29, 29)
    assert np.isnan([cell.value, cell.low, cell.high]).all()


def test_same_seed_same_interval_and_other_seed_another():
    value = np.random.default_rng(0).normal(size=60)
    one, again, other = (estimate(value, units(6, 10), seed=s, purpose="x") for s in (1, 1, 2))
    assert one == again
    assert (one.low, one.high) != (other.low, other.high)


def test_units_that_differ_widen_the_interval():
    rng = np.random.default_rng(0)
    noise, shift = rng.normal(size=200), np.repeat(rng.normal(0, 3, 10), 20)
    alike = estimate(noise, units(10, 20), seed=0, purpose="x")
    unlike = estimate(noise + shift, units(10, 20), seed=0, purpose="x")
    pooled = estimate(noise + shift, units(200, 1), seed=0, purpose="x")
    assert unlike.high - unlike.low > 3 * (alike.high - alike.low)
    assert unlike.high - unlike.low > 1.5 * (pooled.high - pooled.low)


def test_a_within_site_interval_resamples_drivers_only():
    value = np.concatenate([np.zeros(50), np.ones(50)])
    within = estimate(value, units(2, 50), seed=0, purpose="x")
    assert within.status == "within site"
    assert 0.15 < within.high - within.low < 0.25  # 2 * 1.96 * 0.5 / sqrt(100) = 0.196, not the 1 of two units


def test_resamples_keep_units_whole():
    means = bootstrap_means(np.array([0.0, 0.0, 1.0, 1.0]), np.array([0, 0, 1, 1]), np.random.default_rng(0), 400)
    assert set(means.tolist()) == {0.0, 0.5, 1.0}  # two units drawn: none, one or both are the second
    assert 0.4 < (means == 0.5).mean() < 0.6


def test_blocks_do_not_change_what_a_mean_is(monkeypatch):
    monkeypatch.setattr("stylesim.evaluation.intervals.BLOCK", 10)
    means = bootstrap_means(np.arange(50.0), np.arange(50) % 5, np.random.default_rng(0), 300)
    assert means.mean() == pytest.approx(24.5, abs=1.0)


def test_coverage_with_units_and_skewed_errors():
    rng = np.random.default_rng(3)
    hits = 0
    for trial in range(150):
        value = rng.exponential(1, 100) + np.repeat(rng.normal(0, 0.5, 20), 5)
        cell = estimate(value, units(20, 5), seed=trial, purpose="x", draws=400)
        hits += cell.low <= 1.0 <= cell.high
    assert 0.88 <= hits / 150 <= 1.0


def test_a_rate_of_zero_still_has_an_upper_end():
    cell = estimate(np.zeros(40), units(40, 1), seed=0, purpose="x", rate=True)
    assert (cell.low, cell.value) == (0.0, 0.0)
    assert cell.high == pytest.approx(1 - 0.025 ** (1 / 40))
    ones = estimate(np.ones(40), units(4, 10), seed=0, purpose="x", rate=True)
    assert ones.low == pytest.approx(0.025 ** (1 / 4))  # four units, not forty drivers


def test_a_paired_difference_sees_what_two_intervals_cannot():
    rng = np.random.default_rng(0)
    hard = rng.exponential(5, 100)
    ours, theirs = hard, hard + 0.2 + rng.normal(0, 0.1, 100)
    a, b = (estimate(v, units(100, 1), seed=0, purpose="x") for v in (ours, theirs))
    assert a.high > b.low
    change = paired_difference(ours, theirs, units(100, 1), seed=0, purpose="x")
    assert change.excludes_zero
    assert change.value == pytest.approx(-0.2, abs=0.05)


def test_bad_values_are_refused():
    with pytest.raises(ValueError, match="not finite"):
        estimate(np.array([1.0, np.nan]), ["a", "b"], seed=0, purpose="x")
    with pytest.raises((ValueError, TypeError)):  # TypeError where annotations are executed
        paired_difference(np.zeros(3), np.zeros(4), ["a"] * 3, seed=0, purpose="x")


def test_round_trip():
    cell = Estimate(float("nan"), float("nan"), float("nan"), 4, 2, "too few")
    assert Estimate.from_dict(cell.to_dict()).to_dict() == cell.to_dict()
    assert cell.to_dict()["value"] is None
