from __future__ import annotations

import numpy as np

from stylesim.labelers.cuts import tiles, whole
from stylesim.labelers.reduce import frame_count, moments


def seen(*spans: tuple[int, int], frames: int = 40) -> np.ndarray:
    valid = np.zeros((len(spans), frames), bool)
    for row, (start, stop) in enumerate(spans):
        valid[row, start:stop] = True
    return valid


def test_tiles_start_with_each_agent_and_share_what_is_left_over() -> None:
    cut = tiles(seen((0, 40), (5, 28), (3, 9)), 10)
    assert frame_count(cut.window >= 0, cut).tolist() == [[10, 10, 10, 10], [10, 10, 0, 0], [6, 0, 0, 0]]
    assert cut.window[1, 6:26].tolist() == [0] * 10 + [1] * 10
    assert cut.run[1, 5:28].tolist() == [0] * 11 + [1] * 12  # the left-over frames are smoothed with their neighbour


def test_gaps_belong_to_no_window() -> None:
    valid = seen((0, 20), frames=20)
    valid[0, 5] = False
    cut = tiles(valid, 10)
    assert cut.window[0, 5] == cut.run[0, 5] == -1
    assert frame_count(valid, cut).tolist() == [[9, 10]]


def test_moments_equal_numpy_and_skip_the_unknown() -> None:
    rng = np.random.default_rng(0)
    value = rng.normal(size=(3, 40))
    value[rng.random((3, 40)) < 0.2] = np.nan
    value[2] = np.nan
    found = moments(value, tiles(np.ones((3, 40), bool), 20))
    pieces = value[:2].reshape(2, 2, 20)
    np.testing.assert_allclose(found.mean[:2], np.nanmean(pieces, axis=2))
    np.testing.assert_allclose(found.variance[:2], np.nanvar(pieces, axis=2))
    np.testing.assert_array_equal(found.maximum[:2], np.nanmax(pieces, axis=2))
    assert np.isnan(found.mean[2]).all()
    assert (found.count[2] == 0).all()


def test_whole_is_one_window() -> None:
    assert whole(seen((3, 9))).n_windows == 1
