import numpy as np

from stylesim.datasets.crossings import crossing

EAST = np.array([[-50.0, 0.0], [-10.0, 0.0], [10.0, 0.0], [50.0, 0.0]])
NORTH = EAST[:, ::-1]


def test_lines_that_cross_are_found():
    assert crossing({"east": EAST, "north": NORTH, "beside": EAST + np.array([0.0, 60.0])}) == {"east", "north"}
    assert crossing({"east": EAST}) == set()
    assert crossing({}) == set()


def test_lanes_that_follow_merge_or_run_along_do_not():
    on = np.array([[50.0, 0.0], [90.0, 20.0]])
    merge = np.array([[-50.0, -8.0], [10.0, -1.0], [50.0, 0.0]])
    assert crossing({"east": EAST, "on": on, "merge": merge, "left": EAST + np.array([0.0, 3.5])}) == set()


def test_a_bridge_is_no_junction():
    below, above = np.c_[EAST, np.zeros(4)], np.c_[NORTH, np.full(4, 6.0)]
    assert crossing({"below": below, "above": above}) == set()
    assert crossing({"below": below, "above": np.c_[NORTH, np.full(4, 0.5)]}) == {"below", "above"}


def test_long_lanes_are_thinned_without_losing_the_crossing():
    x = np.linspace(-100, 100, 801)
    curve = np.stack([x, 20 * np.sin(x / 30)], -1)
    assert crossing({"curve": curve, "north": NORTH + np.array([20.0, 0.0])}) == {"curve", "north"}
