"""Boundaries abreast of lanes: as finding them place by place gives."""

from __future__ import annotations

import numpy as np
import pytest

from stylesim.datasets.boundaries import MAX_HALF_WIDTH_M, boundaries
from stylesim.datasets.polylines import nearest_points


def _walk(rng: np.random.Generator, n: int, y: float) -> np.ndarray:
    """A line that goes on eastwards about `y`."""
    return np.stack([np.cumsum(rng.uniform(0.3, 1.5, n)), y + np.cumsum(rng.normal(0, 0.1, n))], -1)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_nearest_place_on_the_line(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centres = [_walk(rng, 80, y) for y in (0.0, 20.0)]
    lines = {name: _walk(rng, 200, y).astype(np.float32) for name, y in (("a", 2.0), ("b", -1.5), ("c", 300.0))}
    asked = [[("a", 0, 49), ("b", 40, 79)], [("c", 0, 79)]]
    (line, apart), nothing = boundaries(centres, asked, lines)
    expected, distance = [], []
    for name, start, end in asked[0]:
        places = centres[0][start : end + 1]
        feet = nearest_points(places, lines[name])
        far = np.hypot(*(feet - places).T)
        expected.append(feet[far <= MAX_HALF_WIDTH_M])
        distance.append(far[far <= MAX_HALF_WIDTH_M])
    feet = np.concatenate(expected)
    kept = np.concatenate([[True], np.hypot(*np.diff(feet, axis=0).T) > 1e-6])
    assert line is not None
    np.testing.assert_allclose(line, feet[kept], atol=1e-4)
    assert apart == pytest.approx(np.median(np.concatenate(distance)), abs=1e-9)
    assert nothing[0] is None
    assert np.isnan(nothing[1])


def test_sides_without_a_usable_line_have_none() -> None:
    centre = _walk(np.random.default_rng(0), 10, 0.0)
    lines = {"short": np.zeros((1, 2), np.float32), "empty": np.zeros((0, 2), np.float32)}
    asked = [[("short", 0, 9)], [("empty", 0, 9)], [("unknown", 0, 9)], [], [("short", 7, 3)]]
    assert [line for line, _ in boundaries([centre] * 5, asked, lines)] == [None] * 5


def test_a_line_of_no_points_between_others_moves_nothing() -> None:
    centre = np.stack([np.arange(10.0), np.zeros(10)], -1)
    straight = np.stack([np.arange(10.0), np.full(10, 2.0)], -1).astype(np.float32)
    lines = {"one": straight + 50, "empty": np.zeros((0, 2), np.float32), "two": straight}
    ((line, apart),) = boundaries([centre], [[("two", 0, 9)]], lines)
    np.testing.assert_array_equal(line, straight)
    assert apart == 2.0
