from __future__ import annotations

import numpy as np
import pytest

from stylesim.evaluation.label_summary import label_summary


def test_shares_and_confusion(small_corpus):
    summary = label_summary(small_corpus)
    (source,) = summary.sources
    assert (source.source, source.n, source.n_units) == ("sumo", 200, 40)
    assert sum(source.classes.values()) == sum(source.classes_transposed.values()) == 200
    assert source.classes["undetermined"] == 12
    assert source.share("undetermined") == pytest.approx(0.06)
    assert source.no_neighbours == pytest.approx(0.25)
    assert source.classes_transposed["aggressive"] == 0
    confusion = summary.confusion
    assert confusion.n == 200
    assert confusion.count[0, 1] > 30  # aggressive is measured as reckless in this world
    assert confusion.count[:, 0].sum() == 0
    np.testing.assert_allclose(confusion.share.sum(axis=1), 1.0)
    assert confusion.knob_rank_correlation > 0.95


def test_recorded_drivers_have_no_confusion(world, tmp_path):
    corpus = world.write(tmp_path / "real", [world.scene(0, source="dlr_ut")])
    assert label_summary(corpus).confusion is None
