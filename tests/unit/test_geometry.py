from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stylesim.geometry import arc_length, box_corners, boxes_overlap, project, resampled, rotated, wrap_angle

CORNER = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])


def test_projection_onto_a_corner_by_hand():
    points = np.array([[5.0, 2.0], [5.0, -1.0], [12.0, 5.0], [9.0, 5.0], [-3.0, 4.0]])
    along, offset, distance, segment = project(points, CORNER)
    np.testing.assert_allclose(along, [5, 5, 15, 15, 0])
    np.testing.assert_allclose(offset, [2, -1, -2, 1, 4])
    np.testing.assert_allclose(distance, [2, 1, 2, 1, 5])
    assert segment.tolist() == [0, 0, 1, 1, 0]


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-4, 4))
def test_projection_moves_with_the_world(x, y, turn):
    point = np.array([[x, y]])
    along, offset, distance, _ = project(point, CORNER)
    moved = project(rotated(point, turn) + 3.0, rotated(CORNER, turn) + 3.0)
    assert distance == pytest.approx(moved[2], abs=1e-6)
    if abs(np.abs(x - 10) - np.abs(y)) > 1e-3 or y < 0:  # not on the bisector, where two feet are equally near
        np.testing.assert_allclose(np.abs(offset), np.abs(moved[1]), atol=1e-5)
    assert 0 <= along[0] <= 20 + 1e-9


@given(st.floats(-100, 100))
def test_wrapped_angles_point_the_same_way(angle):
    wrapped = float(wrap_angle(np.array(angle)))
    assert -np.pi <= wrapped < np.pi
    assert np.cos(wrapped) == pytest.approx(np.cos(angle), abs=1e-9)


def test_resampling_keeps_ends_and_length():
    line = resampled(CORNER, 1.0)
    np.testing.assert_allclose(line[[0, -1]], CORNER[[0, -1]])
    assert arc_length(line)[-1] == pytest.approx(20)


@pytest.mark.parametrize(
    ("x", "y", "heading", "hit"),
    [
        (4.9, 0, 0, True),
        (5.1, 0, 0, False),
        (0, 1.9, 0, True),
        (0, 2.1, 0, False),
        (0, 3.4, np.pi / 2, True),
        (0, 3.6, np.pi / 2, False),
    ],
)
def test_boxes_overlap_by_hand(x, y, heading, hit):
    size = np.array([5.0, 2.0])
    a = box_corners(np.zeros(2), np.array(0.0), size)
    b = box_corners(np.array([x, y], float), np.array(float(heading)), size)
    assert bool(boxes_overlap(a, b)) is hit
