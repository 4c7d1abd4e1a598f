from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.evaluation.metrics import METRICS, displacement_errors, forecast_errors

NAN = np.nan


def straight(*end_m: float, steps: int = 2) -> np.ndarray:
    """Modes that go straight along x to the given ends: [mode time 2]."""
    x = np.linspace(0, 1, steps + 1)[1:]
    return np.array([np.stack([x * end, 0 * x], axis=1) for end in end_m])


def test_worked_by_hand():
    # truth ends at 10 m; modes end at 10 (but 3 m aside at first), 13 and 6
    modes = straight(10.0, 13.0, 6.0)[None]
    modes[0, 0, 0] += [0.0, 3.0]
    errors = forecast_errors(modes, np.array([[0.2, 0.5, 0.3]]), straight(10.0))
    assert errors.min_fde_m[0] == 0.0  # mode 0
    assert errors.min_ade_m[0] == pytest.approx(1.5)  # mode 0: (3 + 0) / 2; mode 1: (1.5 + 3) / 2; mode 2: (2 + 4) / 2
    assert errors.miss_rate[0] == 0.0
    assert errors.brier_fde_m[0] == pytest.approx(0.64)  # 0 + (1 - 0.2)^2
    assert errors.top_fde_m[0] == pytest.approx(3.0)  # mode 1
    assert errors.best_mode[0] == 0
    assert errors.best_probability[0] == pytest.approx(0.2)


def test_ade_and_fde_are_minimised_separately():
    truth = straight(10.0, steps=10)
    late = truth[0].copy()
    late[:-1, 1] += 4.0  # right at the end only
    near = truth[0] + [0.0, 1.0]
    errors = forecast_errors(np.stack([late, near])[None], np.array([[0.5, 0.5]]), truth)
    assert (errors.min_fde_m[0], errors.min_ade_m[0]) == pytest.approx((0.0, 1.0))


def test_a_miss_is_more_than_two_metres():
    errors = [
        forecast_errors(straight(10.0 + d)[None], np.ones((1, 1)), straight(10.0)).miss_rate[0] for d in (2.0, 2.001)
    ]
    assert errors == [0.0, 1.0]


def test_final_error_is_taken_at_the_last_valid_step():
    truth = straight(10.0, steps=4)
    truth[0, 2:] = NAN
    errors = forecast_errors(straight(20.0, steps=4)[None], np.ones((1, 1)), truth)
    assert errors.min_fde_m[0] == pytest.approx(5.0)  # 10 - 5 at the second of four steps
    assert errors.min_ade_m[0] == pytest.approx((2.5 + 5.0) / 2)


def test_a_hole_in_the_future_counts_in_no_mean():
    valid = np.array([[True, False, True, True]])
    truth = straight(8.0, steps=4)
    truth[0, 1] = 1e6
    ade, fde = displacement_errors(straight(12.0, steps=4)[None], truth, valid)
    assert (ade[0, 0], fde[0, 0]) == pytest.approx(((1.0 + 3.0 + 4.0) / 3, 4.0))


def test_a_driver_without_a_future_has_no_error():
    errors = forecast_errors(straight(1.0)[None], np.ones((1, 1)), np.full((1, 2, 2), NAN))
    assert all(np.isnan(getattr(errors, name)[0]) for name in METRICS)
    assert errors.best_mode[0] == -1


def test_only_the_most_probable_modes_count_and_keep_their_probabilities():
    modes = straight(10.0, 11.0, 15.0)[None]
    chance = np.array([[0.1, 0.3, 0.6]])
    errors = forecast_errors(modes, chance, straight(10.0), k=2)
    assert (errors.min_fde_m[0], errors.best_mode[0]) == (1.0, 1)
    assert errors.brier_fde_m[0] == pytest.approx(1.0 + 0.7**2)
    scaled = forecast_errors(modes, chance, straight(10.0), k=2, renormalise=True)
    assert scaled.brier_fde_m[0] == pytest.approx(1.0 + (1 - 0.3 / 0.9) ** 2)


@pytest.mark.parametrize(
    ("modes", "chance", "truth", "k"),
    [((1, 2, 3, 2), (1, 3), (1, 3, 2), 6), ((1, 2, 3, 2), (1, 2), (1, 4, 2), 6), ((1, 2, 3, 2), (1, 2), (1, 3, 2), 0)],
)
def test_what_does_not_fit_is_refused(modes, chance, truth, k):
    with pytest.raises((ValueError, TypeError)):  # TypeError where annotations are executed
        forecast_errors(np.zeros(modes), np.zeros(chance), np.zeros(truth), k=k)


@st.composite
def forecasts(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    drivers, modes, steps = draw(st.integers(1, 4)), draw(st.integers(1, 6)), draw(st.integers(1, 8))
    mode_m = np.round(rng.normal(0, 3, (drivers, modes, steps, 2)))  # rounded: equal errors happen
    chance = rng.dirichlet(np.ones(modes), drivers)
    valid = rng.random((drivers, steps)) < 0.7
    return mode_m, chance, np.round(rng.normal(0, 3, (drivers, steps, 2))), valid, rng


@settings(max_examples=60, deadline=None)
@given(forecasts())
def test_laws(case):
    mode_m, chance, truth, valid, rng = case
    errors = forecast_errors(mode_m, chance, truth, valid)
    known = valid.any(axis=1)
    order = rng.permutation(mode_m.shape[1])
    shuffled = forecast_errors(mode_m[:, order], chance[:, order], truth, valid)
    for name in (*METRICS, "best_probability"):
        np.testing.assert_allclose(getattr(errors, name), getattr(shuffled, name), err_msg=name)
    ade, fde = displacement_errors(mode_m, truth, valid)
    assert (errors.min_ade_m[known, None] <= ade[known]).all()
    assert (errors.brier_fde_m[known] >= errors.min_fde_m[known]).all()
    assert (errors.top_fde_m[known] >= errors.min_fde_m[known]).all()
    far = mode_m[:, :1] + 1e4
    worse = forecast_errors(
        np.concatenate([mode_m, far], axis=1),
        np.concatenate([chance * 0.9, 0.1 + 0 * chance[:, :1]], axis=1),
        truth,
        valid,
        k=7,
    )
    np.testing.assert_array_equal(worse.min_fde_m[known], errors.min_fde_m[known])
    assert (fde[known].min(axis=1) == errors.min_fde_m[known]).all()
