from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stylesim.errors import InputError
from stylesim.labelers.mdsi import MDSI
from stylesim.labelers.mdsi_key import FACTORS, STYLES, factor_scores, style_scores
from stylesim.labels import UNDETERMINED
from stylesim.questionnaire import N_ITEMS, answer_key, answers_of

from .made import traffic

NEUTRAL = [3] * N_ITEMS


def said(**items):
    """Neutral answers but for i7=6 and the like."""
    answers = list(NEUTRAL)
    for name, value in items.items():
        answers[int(name[1:]) - 1] = value
    return answers


def judged(*answers, **options):
    scene = traffic(agents=len(answers), seed=1)
    given = {f"car-{i}": row for i, row in enumerate(answers)}
    return MDSI(answers=given, **options).fit([scene]).label_windows(scene)


def test_the_key_is_a_partition_of_the_items_with_the_counts_of_the_styles():
    assert sorted(abs(i) for items in FACTORS.values() for i in items) == list(range(1, 45))
    assert [sum(len(FACTORS[f]) for f in factors) for factors in STYLES.values()] == [11, 19, 5, 9]
    assert sorted(i for items in FACTORS.values() for i in items if i < 0) == [-40, -29, -21, -4]


def test_factors_by_hand():
    """Items 4, 21, 29, 40 are reversed: 7 - x. Neutral 3 gives 4 there."""
    found = judged(NEUTRAL, said(i4=6, i40=1, i7=5, i6=6, i20=6, i22=6, i24=6, i44=1, i13=1, i21=6))
    names = found.feature_names
    neutral = dict(zip(names, found.feature[0].tolist(), strict=True))
    assert neutral["risky"] == 3.0
    assert neutral["anxious"] == pytest.approx((4 + 3 * 5 + 4) / 7)
    assert neutral["careful"] == pytest.approx((3 + 4 + 4 + 3 + 3) / 5)
    other = dict(zip(names, found.feature[1].tolist(), strict=True))
    assert other["anxious"] == pytest.approx((1 + 5 + 3 * 4 + 6) / 7)
    assert other["risky"] == pytest.approx(25 / 5)
    assert other["patient"] == pytest.approx((1 + 3 * 3) / 4)
    assert other["careful"] == pytest.approx((3 + 1 + 4 + 3 + 3) / 5)
    assert other["angry"] == other["high_velocity"] == other["dissociative"] == 3.0


def test_broad_styles_are_means_over_items_not_over_factors():
    found = judged(said(i6=6, i20=6, i22=6, i24=6, i44=6))
    scores = dict(zip(found.classes, found.score[0].tolist(), strict=True))
    assert scores["reckless_careless"] == pytest.approx((5 * 6 + 6 * 3) / 11)
    assert scores["angry_hostile"] == 3.0
    assert scores["anxious"] == pytest.approx((17 * 3 + 2 * 4) / 19)
    assert scores["patient_careful"] == pytest.approx((7 * 3 + 2 * 4) / 9)
    assert found.class_name(0) == "reckless_careless"
    assert found.margin[0] == pytest.approx(48 / 11 - 29 / 9)
    assert found.aggressiveness[0] == pytest.approx((48 / 11 + 3) / 2 - 29 / 9)


def test_a_tie_for_the_first_place_is_undetermined_a_tie_below_it_is_not():
    answers = [7 - 4 if i in (4, 21, 29, 40) else 4 for i in range(1, 45)]  # every style scores 4
    angrier = [6 if i in FACTORS["angry"] else answers[i - 1] for i in range(1, 45)]
    found = judged(answers, angrier)
    assert found.class_name(0) == "undetermined"
    assert found.margin[0] == 0.0
    assert np.isnan(found.aggressiveness[0])
    assert found.class_name(1) == "angry_hostile"


def test_missing_items():
    half = said(i3=6, i12=6, i19=None, i28=None, i43=6)  # 3 of 5 angry items
    few = said(i3=6, i12=6, i19=None, i28=None, i43=None)  # 2 of 5
    found = judged(half, few)
    angry = found.feature_names.index("angry")
    assert found.feature[0, angry] == 6.0
    assert not found.missing[0].any()
    assert found.missing[1].tolist() == [name == "angry" for name in found.feature_names]
    assert [found.class_name(i) for i in range(2)] == ["angry_hostile", "undetermined"]
    assert judged(few, least_share=0.4).class_name(0) == "angry_hostile"


def test_a_driver_without_answers_is_undetermined():
    scene = traffic(agents=3, seed=1)
    found = MDSI(answers={"car-1": said(i3=6, i12=6)}).fit([scene]).label_windows(scene)
    assert found.agent_id == ("car-0", "car-1", "car-2")
    assert found.style.tolist() == [UNDETERMINED, 2, UNDETERMINED]
    assert found.missing[0].all()


def test_answers_travel_with_scenes_but_not_with_their_histories():
    scene = traffic(agents=2, seed=1)
    carried = {answer_key(i + 1, "car-1"): float(v) for i, v in enumerate(said(i3=6, i12=6)) if i != 8}
    scene = replace(scene, parameters={"speed_limit_mps": 13.9, **carried})
    found = MDSI().fit([scene]).label_windows(scene)
    assert [found.class_name(i) for i in range(2)] == ["undetermined", "angry_hostile"]
    assert np.isnan(answers_of(scene.parameters, "car-1")).nonzero()[0].tolist() == [8]
    assert answers_of(scene.history(50, 20).parameters, "car-1") is None
    history = MDSI().fit([scene]).label_windows(scene, [0, 30], 50, span="history")
    assert history.stop_frame.tolist() == [50, 50, 80, 80]
    assert [history.class_name(i) for i in range(4)] == ["undetermined", "angry_hostile"] * 2


def test_a_norm_standardises_over_the_sample():
    rng = np.random.default_rng(0)
    people = rng.integers(1, 7, (30, 44)).astype(float)
    people[:, [i - 1 for i in (*FACTORS["patient"], 14, 41, 42)]] = 6  # all agree with patience
    people[:, 12] = rng.integers(5, 7, 30)
    scene = traffic(agents=30, seed=1)
    given = {f"car-{i}": row.tolist() for i, row in enumerate(people)}
    raw = MDSI(answers=given).fit([scene]).label_windows(scene)
    assert (raw.style == 3).mean() > 0.9
    made = MDSI(answers=given, norm="sample").fit([scene])
    normed = made.label_windows(scene)
    np.testing.assert_allclose(normed.score.mean(axis=0), 0, atol=1e-6)
    np.testing.assert_allclose(normed.score.std(axis=0, ddof=1), 1, atol=1e-6)
    assert (normed.style == 3).mean() < 0.6


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"answers": {"car-0": [3] * 43}}, "43 answers"),
        ({"answers": {"car-0": said(i5=7)}}, "item 5 is 7"),
        ({"answers": {"car-0": said(i5=0)}}, "item 5 is 0"),
        ({"answers": {"car-0": said(i5=2.5)}}, "item 5 is 2.5"),
        ({"answers": {"car-0": said(i5=float("inf"))}}, "item 5"),
        ({"norm": "samples"}, "Did you mean 'sample'"),
        ({"norm": "sample"}, "a norm needs 10"),
        ({"least_share": 0.0}, "least_share"),
    ],
)
def test_bad_input_is_refused_in_words(options, says):
    with pytest.raises(InputError, match=says):
        MDSI(**options).fit([traffic(agents=2, seed=1)])


def test_it_must_be_fitted():
    with pytest.raises(InputError, match="call fit"):
        MDSI().label_windows(traffic())
    with pytest.raises(InputError, match="not an MDSI labeller"):
        MDSI.from_dict({"labeler": "kdsc"})


answers = st.lists(st.one_of(st.integers(1, 6), st.none()), min_size=44, max_size=44)


@given(answers)
def test_scores_stay_on_the_scale_and_mirror(row):
    array = np.array([[np.nan if v is None else float(v) for v in row]])
    factors, styles = factor_scores(array, 0.5), style_scores(array, 0.5)
    for found in (factors, styles):
        known = found[np.isfinite(found)]
        assert ((known >= 1) & (known <= 6)).all()
    np.testing.assert_allclose(factor_scores(7 - array, 0.5), 7 - factors)
    np.testing.assert_allclose(style_scores(7 - array, 0.5), 7 - styles)
