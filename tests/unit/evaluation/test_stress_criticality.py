from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from stylesim.evaluation.latency import latency
from stylesim.evaluation.stress import stress
from stylesim.evaluation.stress_corpora import own_traffic
from stylesim.evaluation.stress_criticality import BRAKING, TTC, VALUES, with_criticality
from stylesim.windows import WindowSpec
from tests.unit.evaluation.test_decisions import DT_S, along_x, drive


@pytest.fixture(scope="module")
def closing(world, tmp_path_factory):
    """Car 0 closes on car 1 from 60 m at 8 m/s until 6 s, then keeps its speed; car 2 is alone on its lane."""
    t = np.arange(150) * DT_S
    fast = np.where(t < 6.0, 18 * t, 108 + 10 * (t - 6.0))
    scene = drive([along_x(fast), along_x(64 + 10 * t), along_x(12 * t, 7.0)], road=world.scene(0).road)
    return world.write(tmp_path_factory.mktemp("close") / "close", [scene], with_labels=False)


def windows(*rows):
    names = {"scene_id": pl.String, "agent_id": pl.String, "t0_frame": pl.Int32}
    return pl.DataFrame(rows, schema=names, orient="row")


def test_the_least_of_the_future_counts_and_nothing_of_the_past(closing):
    asked = windows(("s", "car0", 20), ("s", "car0", 80), ("s", "car2", 20), ("s", "car1", 20))
    found = with_criticality(asked, closing, future_s=4.0)
    # at 6 s the gap is 64 - 4 - 48 = 12 m at 8 m/s: 1.5 s; needed 64 / 24 = 2.7 m/s²
    critical, close, none = VALUES[TTC]
    assert found[TTC].to_list()[1:] == [none, none, none]
    assert found[TTC][0] in (critical, close)
    assert found[BRAKING].to_list() == [VALUES[BRAKING][1], *[VALUES[BRAKING][2]] * 3]


def test_every_window_is_in_one_class_of_each(world, small_corpus):
    found = stress(world.ConstantVelocity(), own_traffic(small_corpus))
    total = found.evaluation.overall.n_windows
    for by in (TTC, BRAKING):
        assert sum(one.n_windows for one in found.criticality if one.by == by) == total


def test_latency_is_of_single_scenes(world, small_corpus):
    slow = world.ConstantVelocity()
    found = latency(slow, (small_corpus,), spec=WindowSpec())
    assert found.scenes == 2  # of the first scene: it has two t0
    assert 0 < found.cpu_median_ms <= found.cpu_p95_ms
    assert 0 < found.wall_median_ms <= found.wall_p95_ms
    assert "cores" in found.machine
    assert all(len(task.agent_index) <= 32 for task in slow.asked)
    late = replace(WindowSpec(), history_s=500.0)
    assert latency(slow, (small_corpus,), spec=late) is None
