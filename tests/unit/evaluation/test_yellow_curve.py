"""Curves, intervals and trends against numbers of others."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import expit

from stylesim.evaluation.approaches import Approaches
from stylesim.evaluation.yellow_curve import (
    Share,
    cochran_armitage,
    curve_rmse,
    deceleration_near,
    decreases,
    ran_red,
    stop_curve,
)


def approaches(n: int = 20_000, *, slope: float = 2.14, midpoint: float = 2.88) -> Approaches:
    rng = np.random.default_rng(1)
    tts = rng.uniform(1.0, 6.0, n)
    stopped = rng.random(n) < expit(slope * (tts - midpoint))
    return Approaches(
        style=("neutral",) * n,
        unit=("unit",) * n,
        tts_s=tts,
        speed_mps=np.full(n, 20.0),
        free=np.ones(n, bool),
        decided=stopped.astype(np.int64),
        stopped=stopped,
        ran_red=~stopped & (tts > 4.0),
        response_s=np.where(stopped, 1.0, np.nan),
        deceleration_mps2=np.where(stopped, 20.0 / (2 * (tts - 0.9)), np.nan),
        counts={},
    )


def test_a_driver_of_the_published_curve_has_no_error() -> None:
    bins = stop_curve(approaches(), slope_per_s=2.14, midpoint_s=2.88)
    assert len(bins) == 20
    assert sum(item.stopped.n for item in bins) == 20_000
    assert curve_rmse(bins) < 0.02
    assert curve_rmse(stop_curve(approaches(midpoint=3.4), slope_per_s=2.14, midpoint_s=2.88)) > 0.1


def test_wilson_interval_of_a_textbook_case() -> None:
    low, high = Share(15, 148).interval  # Newcombe 1998, table I: 0.0624 to 0.1605
    assert (round(low, 4), round(high, 4)) == (0.0624, 0.1605)
    assert np.isnan(Share(0, 0).value)


def test_trend_of_a_textbook_case() -> None:
    # Agresti, An Introduction to Categorical Data Analysis: alcohol and malformation, M2 = 6.57 with 1 df
    shares = [Share(48, 17114), Share(38, 14502), Share(5, 793), Share(1, 127), Share(1, 38)]
    z, p = cochran_armitage(shares, np.array([0.0, 0.5, 1.5, 4.0, 7.0]))
    assert z**2 == pytest.approx(6.57, abs=0.01)
    assert p == pytest.approx(0.0052, abs=0.0003)


def test_no_trend_where_nothing_happens() -> None:
    assert all(np.isnan(cochran_armitage([Share(0, 10), Share(0, 20)])))


def test_decreases_are_found_beyond_intervals_only() -> None:
    assert decreases([Share(100, 1000), Share(90, 1000), Share(20, 1000)]) == [2]


def test_decelerations_and_red_running() -> None:
    found = approaches()
    mean, n = deceleration_near(found, 5.6)
    assert mean == pytest.approx(2.13, abs=0.05)
    assert n > 1000
    assert 0 < ran_red(found).value < 0.02
