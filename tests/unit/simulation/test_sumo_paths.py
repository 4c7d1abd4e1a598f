"""Arithmetic on rows: directions, places further back."""

from __future__ import annotations

import numpy as np

from stylesim.simulation.sumo.paths import Segments, directions, points_behind


def rows(*tracks: np.ndarray) -> tuple[np.ndarray, Segments]:
    driver = np.repeat(np.arange(len(tracks), dtype=np.int32), [len(t) for t in tracks])
    step = np.concatenate([np.arange(len(t), dtype=np.int32) for t in tracks])
    return np.concatenate(tracks).astype(np.float64), Segments.of(driver, step)


def test_segments_end_where_steps_are_missing() -> None:
    segments = Segments.of(np.array([0, 0, 0, 1], np.int32), np.array([4, 5, 7, 8], np.int32))
    np.testing.assert_array_equal(segments.starts, [0, 2, 3])
    np.testing.assert_array_equal(segments.first, [0, 0, 2, 3])


def test_directions_hold_while_standing() -> None:
    moving = np.array([[0, 0], [0, 0], [1, 0], [1, 0], [1, 2]])
    standing = np.array([[5, 5], [5, 5]])
    points, segments = rows(moving, standing)
    unit = directions(points, segments, np.full(len(points), np.pi / 2))
    np.testing.assert_allclose(unit, [[0, 1], [0, 1], [1, 0], [1, 0], [0, 1], [0, 1], [0, 1]], atol=1e-12)


def test_places_further_back_lie_on_the_path() -> None:
    corner = np.array([[0, 0], [4, 0], [4, 4], [4, 4], [4, 8]])
    other = np.array([[0, 9], [0, 10]])
    points, segments = rows(corner, other)
    unit = directions(points, segments, np.repeat([0.0, np.pi / 2], [5, 2]))
    (behind,) = points_behind(points, unit, segments, (np.full(len(points), 3.0),))
    expected = [[-3, 0], [1, 0], [4, 1], [4, 1], [4, 5], [0, 6], [0, 7]]
    np.testing.assert_allclose(behind, expected, atol=1e-9)
