from __future__ import annotations

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.tdbm import TDBM
from stylesim.labelers.tdbm_matrix import scores
from stylesim.labels import UNDETERMINED, LabelFlag
from stylesim.style import STYLE_CLASSES

from .made import lanes, scene_of, straight, traffic


@pytest.fixture(scope="module")
def fitted() -> TDBM:
    return TDBM().fit([traffic(seed=1)])


def as_fitted(fitted: TDBM, **changed: str) -> TDBM:
    return TDBM.from_dict(fitted.to_dict() | changed)


def test_scores_class_margin_and_a_follow_from_the_scaled_features(fitted: TDBM) -> None:
    found = fitted.label_windows(traffic(seed=3))
    known = found.style != UNDETERMINED
    assert known.sum() > 30
    highway = (found.flags & int(LabelFlag.HIGHWAY)) != 0
    scaled, _ = fitted.track_scaler_.scaled(found.feature.astype(np.float64), highway)
    wanted = scores(scaled)
    np.testing.assert_allclose(found.score[known], wanted[known], atol=1e-4)
    np.testing.assert_array_equal(found.style[known], found.score[known].argmax(axis=1))
    ordered = np.sort(found.score, axis=1)
    np.testing.assert_allclose(found.margin[known], (ordered[:, -1] - ordered[:, -2])[known], atol=1e-5)
    weights = np.array([1, 0.6, 0.2, -0.2, -0.6, -1])
    np.testing.assert_allclose(found.aggressiveness[known], wanted[known] @ weights, atol=1e-4)
    assert found.score_transposed is not None
    np.testing.assert_allclose(found.score_transposed[known], scores(scaled, "transposed")[known], atol=1e-4)


def test_a_feature_that_cannot_be_known_leaves_no_class(fitted: TDBM) -> None:
    found = fitted.label_windows(scene_of([straight(0, 10), straight(30, 10)]))
    assert (found.style == UNDETERMINED).all()
    assert found.missing[:, 0].all()
    assert np.isnan(found.feature[:, 0]).all()
    assert np.isnan(found.aggressiveness).all()
    assert not found.missing[:, 1:].any()


def test_short_tracks_stay_and_are_flagged(fitted: TDBM) -> None:
    brief, instant = straight(0, 10), straight(60, 10)
    brief[40:] = np.nan
    instant[5:] = np.nan
    found = fitted.label_windows(scene_of([brief, instant, straight(30, 9)], road=lanes()))
    assert found.agent_id == ("car-0", "car-1", "car-2")
    assert ((found.flags & int(LabelFlag.SHORT)) != 0).tolist() == [True, True, False]
    assert (found.style != UNDETERMINED).tolist() == [True, False, True]
    assert found.stop_frame.tolist() == [40, 5, 110]


def test_policies_for_drivers_without_neighbours(fitted: TDBM) -> None:
    alone = scene_of([straight(0, 10)], road=lanes())
    assert fitted.label_windows(alone).style[0] != STYLE_CLASSES.index("threatening")
    named = as_fitted(fitted, no_neighbours="threatening").label_windows(alone)
    assert named.class_name(0) == "threatening"
    refused = as_fitted(fitted, no_neighbours="undetermined").label_windows(alone)
    assert refused.class_name(0) == "undetermined"
    assert np.isnan(refused.aggressiveness[0])


def test_the_other_orientation_decides_on_request(fitted: TDBM) -> None:
    scene = traffic(seed=3)
    printed, transposed = fitted.label_windows(scene), as_fitted(fitted, orientation="transposed").label_windows(scene)
    assert transposed.method == "tdbm_transposed"
    np.testing.assert_array_equal(transposed.style, printed.style_transposed)
    np.testing.assert_array_equal(transposed.aggressiveness, printed.aggressiveness)


def test_unknown_choices_are_refused_by_name() -> None:
    with pytest.raises(InputError, match="Did you mean 'printed'"):
        TDBM(orientation="print")
    with pytest.raises(InputError, match="threatening"):
        TDBM(no_neighbours="threat")
    with pytest.raises(InputError, match="Did you mean 'radius_m'"):
        FeatureOptions.from_dict({"radius": 3})


def test_a_history_of_a_length_that_was_not_fitted_is_refused(fitted: TDBM) -> None:
    with pytest.raises(InputError, match=r"no scaler for histories of 2 s.*: 5\."):
        fitted.label_windows(traffic(), [0], 20, span="history")


def test_windows_given_by_their_starts_are_averaged(fitted: TDBM) -> None:
    scene = traffic(seed=3)
    parts = [fitted.label_windows(scene, [start], 110) for start in (0, 110)]
    both = fitted.label_windows(scene, [0, 110], 110)
    speed = [labels.feature[:, 3] for labels in (*parts, both)]
    np.testing.assert_allclose(speed[2], (speed[0] + speed[1]) / 2, rtol=1e-5)
