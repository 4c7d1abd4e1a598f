"""Which classes a box of features leaves room for, and the extremes that make the box."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.errors import InputError
from stylesim.evaluation.freedom import extremes, freedom, greatest_lead
from stylesim.labelers.tdbm_matrix import scores
from stylesim.style import STYLE_CLASSES, class_of_knob
from stylesim.styles import style_table

CUBE = np.tile([0.0, 1.0], (5, 1))
boxes = st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=5, max_size=5).map(
    lambda pairs: np.sort(np.array(pairs), axis=1)
)


def test_the_whole_cube_has_room_for_everybody_and_without_v_nei_threatening_has_none():
    """REFERENCE section 1 [computed]: all six are reachable; with v_nei = 0 "threatening" can never win."""
    assert all(greatest_lead(place, CUBE) > 0 for place in range(6))
    alone = CUBE.copy()
    alone[1] = 0.0
    assert greatest_lead(STYLE_CLASSES.index("threatening"), alone) < 0
    assert greatest_lead(STYLE_CLASSES.index("careful"), alone) > 0


@given(boxes)
@settings(max_examples=40, deadline=None)
def test_no_point_of_the_box_beats_the_greatest_lead(box):
    points = np.random.default_rng(0).uniform(box[:, 0], box[:, 1], (400, 5))
    found = scores(points)
    for place in range(6):
        lead = found[:, place] - np.delete(found, place, axis=1).max(axis=1)
        assert lead.max() <= greatest_lead(place, box) + 1e-7


def test_a_point_is_its_own_box():
    point = np.array([[0.3, 0.3], [0.8, 0.8], [0.1, 0.1], [0.5, 0.5], [0.9, 0.9]])
    score = np.sort(scores(point[:, :1].T)[0])
    best = int(scores(point[:, :1].T)[0].argmax())
    assert greatest_lead(best, point) == pytest.approx(score[-1] - score[-2])


@pytest.mark.parametrize("backend", ["sumo", "highway"])
def test_extremes_are_drivers_that_differ_in_what_they_say(backend):
    found = dict(extremes(style_table(backend=backend), limit_mps=30.0))
    assert len(found) >= 40
    assert found["lane_wander_m 0"].lane_wander_m == 0.0
    assert found["all bold"].time_headway_s < found["all calm"].time_headway_s
    assert found["all calm, fast"].desired_speed_factor == found["all bold"].desired_speed_factor
    classes = {class_of_knob(style.aggressiveness) for what, style in found.items() if " at " in what}
    assert classes == set(STYLE_CLASSES)


def test_no_episode_and_no_such_scenario_are_refused():
    with pytest.raises(InputError, match="at least one episode"):
        freedom(["highway"], episodes=0)
    with pytest.raises(InputError, match="Did you mean 'highway'"):
        freedom(["highwy"])


@pytest.mark.slow
def test_a_neutral_drivers_vehicle_at_some_extremes(monkeypatch):
    import stylesim.evaluation.freedom as module

    some = ("all calm", "all bold", "lane_wander_m 0", "lane_wander_m 0.7")
    every = module.extremes
    monkeypatch.setattr(module, "extremes", lambda *a, **k: (e for e in every(*a, **k) if e[0] in some))
    (one,) = freedom(["highway"], episodes=1, seed=5)
    assert one.drives + one.too_short == len(some)
    assert (one.reached[:, 0] < one.reached[:, 1]).all()
    wander = one.names.index("s_center")
    assert one.best[wander][0] in ("lane_wander_m 0", "all calm")
    assert freedom(["highway"], episodes=1, seed=5)[0].to_dict() == one.to_dict()
