"""Statistics of commanded against measured, held against scikit-learn and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import spearmanr
from sklearn.metrics import balanced_accuracy_score, cohen_kappa_score

from stylesim.evaluation import agreement as stats
from stylesim.evaluation.fidelity_agreement import Measured, agreement_of
from stylesim.evaluation.intervals import bootstrap_weights
from stylesim.style import STYLE_CLASSES

classes = st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=3, max_size=60)


def one_hot(style: np.ndarray) -> np.ndarray:
    return np.eye(6)[style]


@given(classes)
@settings(deadline=None, max_examples=60)
@pytest.mark.filterwarnings("ignore:y_pred contains classes not in y_true")
def test_balanced_accuracy_and_kappa_are_scikit_learns(pairs):
    commanded, measured = np.array(pairs).T
    count = stats.confusion(np.ones((1, len(pairs))), commanded, one_hot(measured))
    if len({*commanded, *measured}) > 1:  # scikit-learn warns of a single class
        assert stats.balanced_accuracy(count)[0] == pytest.approx(balanced_accuracy_score(commanded, measured))
        wanted = cohen_kappa_score(commanded, measured, weights="quadratic", labels=np.arange(6))
        assert stats.quadratic_kappa(count)[0] == pytest.approx(wanted)
    else:
        assert stats.balanced_accuracy(count)[0] == 1.0
        assert np.isnan(stats.quadratic_kappa(count)[0])


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9), st.integers(0, 3)), min_size=4, max_size=40))
@settings(deadline=None, max_examples=60)
def test_weighted_spearman_is_that_of_the_resample_written_out(rows):
    first, second, times = np.array(rows, float).T
    a, b = np.repeat(first, times.astype(int)), np.repeat(second, times.astype(int))
    if len(a) < 2 or np.ptp(a) == 0 or np.ptp(b) == 0:
        return
    found = stats.spearman(times[None], first, second)[0]
    assert found == pytest.approx(spearmanr(a, b).statistic, abs=1e-9)


def test_resampled_weights_keep_whole_units_together():
    group = np.repeat(np.arange(8), [3, 1, 5, 2, 7, 4, 2, 6])
    blocks = list(bootstrap_weights(group, np.random.default_rng(0), 400))
    weight = np.concatenate(blocks)
    assert weight.shape == (400, 30)
    drawn = np.stack([weight[:, group == unit].sum(axis=1) for unit in range(8)], axis=1)
    size = np.bincount(group)
    assert (drawn % size == 0).all()  # a unit is drawn as often as it is, with as many drivers as it has
    assert (drawn / size).sum(axis=1) == pytest.approx(8)


def measured(share: np.ndarray, a: np.ndarray) -> Measured:
    return Measured("tdbm", "made", "track", STYLE_CLASSES, share, a)


def people(n: int = 240, units: int = 12) -> tuple[np.ndarray, np.ndarray, list[str]]:
    rng = np.random.default_rng(3)
    commanded = np.arange(n) % 6
    return commanded, 1.0 - 0.4 * commanded + rng.uniform(-0.2, 0.2, n), [f"u{i % units}" for i in range(n)]


def test_drivers_that_measure_as_commanded_agree_perfectly():
    commanded, knob, unit = people()
    found = agreement_of("g", commanded, knob, unit, measured(one_hot(commanded), knob * 3), np.ones(240, bool))
    assert {name: value.value for name, value in found.estimates.items()} == pytest.approx(
        dict.fromkeys(("balanced_accuracy", "kappa", "class_rank", "knob_to_a"), 1.0)
        | {
            "class_to_a": found.estimates["class_to_a_ceiling"].value,
            "class_to_a_ceiling": pytest.approx(0.986, abs=0.01),
        }
    )
    assert found.classes_present == 6
    assert found.per_class == (40,) * 6


def test_a_known_confusion_and_its_interval():
    """Half of the aggressive measure as reckless: recalls .5, 1, 1, 1, 1, 1."""
    commanded, knob, unit = people()
    style = commanded.copy()
    style[np.flatnonzero(commanded == 0)[::2]] = 1
    found = agreement_of("g", commanded, knob, unit, measured(one_hot(style), knob), np.ones(240, bool))
    accuracy = found.estimates["balanced_accuracy"]
    assert accuracy.value == pytest.approx(5.5 / 6)
    assert accuracy.low < accuracy.value < accuracy.high
    assert accuracy.n_units == 12 and accuracy.status == "general"
    assert found.count[0].tolist() == [20, 20, 0, 0, 0, 0]


def test_windows_count_a_driver_once():
    commanded, knob, unit = people()
    share = one_hot(commanded) * 0.75
    share[np.arange(240), (commanded + 1) % 6] = 0.25
    found = agreement_of("g", commanded, knob, unit, measured(share, knob), np.ones(240, bool))
    assert found.n_drivers == 240
    assert found.estimates["balanced_accuracy"].value == pytest.approx(0.75)


def test_undetermined_drivers_and_small_groups_give_no_figure():
    commanded, knob, unit = people()
    share = one_hot(commanded)
    share[40:] = 0.0
    known = measured(share, np.where(share.sum(axis=1) > 0, knob, np.nan))
    assert agreement_of("g", commanded, knob, unit, known, np.ones(240, bool)).n_drivers == 40
    few = agreement_of("g", commanded, knob, unit, known, np.arange(240) < 20)
    assert few.estimates["kappa"].refused and np.isnan(few.estimates["kappa"].value)


def test_the_same_seed_gives_the_same_interval():
    commanded, knob, unit = people()
    style = np.random.default_rng(1).integers(0, 6, 240)
    first, second, other = (
        agreement_of("g", commanded, knob, unit, measured(one_hot(style), knob), np.ones(240, bool), seed=s)
        for s in (1, 1, 2)
    )
    assert first.to_dict() == second.to_dict()
    assert first.to_dict() != other.to_dict()
