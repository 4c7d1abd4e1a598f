import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stylesim.datasets.maps.shapes import MIN_CROSSING_RAD, aligned, between, crossed, distinct, evenly
from stylesim.datasets.maps.units import speed_mps


def arc(radius, turn, begin, points=300):
    angle = begin + np.linspace(0, turn, points)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@given(
    radius=st.floats(8, 500),
    turn=st.floats(0.05, 2.5),
    begin=st.floats(-3, 3),
    width=st.floats(2.5, 5),
    flips=st.tuples(st.booleans(), st.booleans()),
)
def test_bounds_come_out_in_driving_direction_however_they_were_drawn(radius, turn, begin, width, flips):
    # Driving counter-clockwise, the inner arc is on the left.
    left, right = arc(radius - width / 2, turn, begin), arc(radius + width / 2, turn, begin, 170)
    one, other = (line[::-1] if flip else line for line, flip in zip((left, right), flips, strict=True))
    found_left, found_right, left_turned, right_turned = aligned(one, other)
    np.testing.assert_array_equal(found_left, left)
    np.testing.assert_array_equal(found_right, right)
    assert (left_turned, right_turned) == flips
    centre, found_width = between(found_left, found_right)
    np.testing.assert_allclose(np.hypot(*centre.T), radius, atol=0.15)
    assert found_width == pytest.approx(width, rel=0.03)


def test_lines_without_length_are_refused():
    for bad in (np.zeros((5, 2)), np.zeros((1, 2)), np.array([[0, 0], [np.nan, 1]])):
        with pytest.raises(ValueError, match=r"point"):
            distinct(bad.astype(float))
    np.testing.assert_array_equal(distinct(np.array([[0.0, 0], [0, 0], [1, 0]])), [[0, 0], [1, 0]])


def test_lanes_cross_but_do_not_when_they_merge_or_follow():
    east = np.array([[0.0, 0], [100, 0]])
    north = np.array([[50.0, -50], [50, 50]])
    beside = east + np.array([0, 3.5])
    after = np.array([[100.0, 0], [150, 0]])
    merging = np.array([[0.0, -8], [60, -2], [100, 0]])
    assert crossed([east, north, beside, after]).tolist() == [True, True, True, False]
    assert not crossed([east, beside, after, merging]).any()


def crossing_of_all_segments(one, other):
    """The angle and the places (shares of the lines) of every meeting of two lines, pair of segments by pair."""
    for i, j in itertools.product(range(len(one) - 1), range(len(other) - 1)):
        r, s = one[i + 1] - one[i], other[j + 1] - other[j]
        cross = r[0] * s[1] - r[1] * s[0]
        if cross:
            gap = other[j] - one[i]
            t, u = (gap[0] * s[1] - gap[1] * s[0]) / cross, (gap[0] * r[1] - gap[1] * r[0]) / cross
            if 0 <= t <= 1 and 0 <= u <= 1:
                sine = abs(cross) / (np.hypot(*r) * np.hypot(*s))
                yield sine, (i + t) / (len(one) - 1), (j + u) / (len(other) - 1)


@given(seed=st.integers(0, 10_000), points=st.tuples(st.integers(2, 12), st.integers(2, 12)), far=st.floats(0, 60))
def test_crossings_are_those_of_all_pairs_of_segments(seed, points, far):
    rng = np.random.default_rng(seed)
    one, other = (np.cumsum(rng.normal(3, 4, (n, 2)), axis=0) for n in points)
    other += far
    found = list(crossing_of_all_segments(evenly(one, len(one)), evenly(other, len(other))))
    wanted = any(sine > np.sin(MIN_CROSSING_RAD) and 0.02 < a < 0.98 and 0.02 < b < 0.98 for sine, a, b in found)
    assert crossed([one, other]).tolist() == [wanted] * 2


@pytest.mark.parametrize(
    ("text", "metres_per_second"),
    [("50", 13.889), ("50 km/h", 13.889), ("15mph", 6.706), ("30 MPH", 13.411), ("13.9 m/s", 13.9)],
)
def test_speeds_carry_their_units(text, metres_per_second):
    assert speed_mps(text) == pytest.approx(metres_per_second, abs=1e-3)


@pytest.mark.parametrize("text", [None, "", "none", "-5", "50 furlongs", "1e3", "nan"])
def test_what_is_no_speed_is_unknown(text):
    assert np.isnan(speed_mps(text))
