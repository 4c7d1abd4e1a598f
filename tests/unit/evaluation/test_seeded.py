from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.evaluation.seeded import seeded_difference, seeded_mean

UNITS = np.repeat(np.arange(12), 5).astype(str).tolist()


def pair(gain: float, *, seeds: int = 5, noise: float = 0.2, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Errors about 5 m of 60 drivers, the first smaller by `gain` (a share) but for noise."""
    rng = np.random.default_rng(seed)
    theirs = rng.uniform(4.0, 6.0, (seeds, len(UNITS)))
    return theirs * (1.0 - gain) + rng.normal(0.0, noise, theirs.shape), theirs


def test_a_gain_is_found_and_its_size_is_right() -> None:
    found = seeded_difference(*pair(0.1), UNITS, seed=0, purpose="t", relative=True)
    assert found.value == pytest.approx(-0.1, abs=0.01)
    assert found.low < found.value < found.high < 0
    assert found.excludes_zero and not found.within(0.05)
    assert (found.n_drivers, found.n_units, found.n_seeds, found.status) == (60, 12, 5, "general")
    metres = seeded_difference(*pair(0.1), UNITS, seed=0, purpose="t")
    assert metres.value == pytest.approx(-0.5, abs=0.05)


def test_nothing_is_equivalent_only_if_it_is_known_well() -> None:
    sure = seeded_difference(*pair(0.0), UNITS, seed=0, purpose="t", relative=True, level=0.9)
    assert sure.within(0.015) and not sure.excludes_zero
    unsure = seeded_difference(*pair(0.0, noise=3.0), UNITS, seed=0, purpose="t", relative=True, level=0.9)
    assert not unsure.within(0.015)  # an interval that merely includes 0 is no equivalence


def test_seeds_that_disagree_widen_the_interval() -> None:
    ours, theirs = pair(0.0)
    shift = np.array([-1.0, 1.0, -1.0, 1.0, 0.0])[:, None]
    calm = seeded_difference(ours, theirs, UNITS, seed=0, purpose="t")
    torn = seeded_difference(ours + shift, theirs, UNITS, seed=0, purpose="t")
    assert torn.high - torn.low > 5 * (calm.high - calm.low)


def test_of_seeds_alone_the_variance_is_that_of_their_mean() -> None:
    """Drivers alike, only seeds differ: the sd of the resamples is s / sqrt(S), with S - 1 in s."""
    by_seed = np.array([0.0, 1.0, 3.0, 4.0])
    value = np.repeat(by_seed[:, None], len(UNITS), axis=1)
    found = seeded_mean(value, UNITS, seed=0, purpose="t", level=0.6827, draws=20_000)
    assert (found.high - found.low) / 2 == pytest.approx(by_seed.std(ddof=1) / 2, rel=0.25)


def test_few_units_and_few_drivers() -> None:
    ours, theirs = pair(0.1)
    here = seeded_difference(ours, theirs, ["a"] * 60, seed=0, purpose="t")
    assert here.status == "within site" and np.isfinite(here.low)
    few = seeded_difference(ours[:, :20], theirs[:, :20], UNITS[:20], seed=0, purpose="t")
    assert few.refused and np.isnan(few.value) and not few.excludes_zero and not few.within(1.0)
    assert few.to_dict()["value"] is None


def test_refusals() -> None:
    ours, theirs = pair(0.1)
    with pytest.raises(ValueError, match="units"):
        seeded_difference(ours, theirs, UNITS[:-1], seed=0, purpose="t")
    with pytest.raises(ValueError, match="not finite"):
        seeded_mean(np.full((2, 60), np.nan), UNITS, seed=0, purpose="t")
    with pytest.raises(ValueError, match="no training seed"):
        seeded_mean(np.zeros((0, 60)), UNITS, seed=0, purpose="t")
    with pytest.raises(ValueError, match="positive"):
        seeded_mean(theirs, UNITS, seed=0, purpose="t").within(0.0)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 6))
def test_the_order_of_ours_and_theirs_only_turns_the_sign(seed: int, seeds: int) -> None:
    ours, theirs = pair(0.05, seeds=seeds, seed=seed)
    there = seeded_difference(ours, theirs, UNITS, seed=1, purpose="t", draws=200)
    back = seeded_difference(theirs, ours, UNITS, seed=1, purpose="t", draws=200)
    assert back.value == pytest.approx(-there.value)
    assert (back.low, back.high) == pytest.approx((-there.high, -there.low))
