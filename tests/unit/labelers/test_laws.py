"""Laws that hold for any scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stylesim.labelers.history import history_labels
from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.tdbm import TDBM
from stylesim.labels import StyleLabels

from .made import reordered, traffic, turned

few = settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
Fitted = TDBM | KDSC


@pytest.fixture(scope="module", params=[TDBM, KDSC])
def fitted(request: pytest.FixtureRequest) -> Fitted:
    made: Fitted = request.param().fit([traffic(seed=1)])
    return made


def same_bits(a: StyleLabels, b: StyleLabels) -> None:
    for name in ("score", "style", "margin", "aggressiveness", "feature", "missing", "flags"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


@few
@given(angle=st.floats(-3.1, 3.1), x=st.floats(-300, 300), y=st.floats(-300, 300), seed=st.integers(0, 5))
def test_a_rigid_motion_of_the_scene_changes_no_label(
    fitted: Fitted, angle: float, x: float, y: float, seed: int
) -> None:
    scene = traffic(agents=12, frames=120, seed=seed)
    before, after = fitted.label_windows(scene), fitted.label_windows(turned(scene, angle, (x, y)))
    np.testing.assert_allclose(after.score, before.score, atol=0.05)  # float32 positions, 0.06 mm at 600 m
    clear = before.margin > 0.1
    np.testing.assert_array_equal(after.style[clear], before.style[clear])


@few
@given(order=st.permutations(list(range(12))), seed=st.integers(0, 5))
def test_the_order_of_the_agents_changes_no_label(fitted: Fitted, order: list[int], seed: int) -> None:
    scene = traffic(agents=12, frames=120, seed=seed)
    before = fitted.label_windows(scene)
    after = fitted.label_windows(reordered(scene, np.array(order)))
    np.testing.assert_allclose(after.score, before.score[order], atol=1e-6)
    np.testing.assert_array_equal(after.style, before.style[order])


@few
@given(t0=st.integers(49, 110), seed=st.integers(0, 5))
def test_nothing_after_t0_reaches_a_history_label(fitted: Fitted, t0: int, seed: int) -> None:
    scene = traffic(agents=12, frames=120, seed=seed)
    wanted = fitted.label_windows(scene, [t0 - 49], 50, span="history")
    tracks = scene.tracks
    later = np.arange(tracks.n_frames) > t0
    garbage = np.random.default_rng(seed).normal(0, 1e4, tracks.position_m.shape).astype(np.float32)
    for ruin in (garbage, np.full_like(garbage, np.nan)):
        valid = tracks.valid & ~(later & np.isnan(ruin).any())
        ruined = replace(
            tracks,
            position_m=np.where(later[:, None], ruin, tracks.position_m),
            velocity_mps=np.where(later[:, None], ruin, tracks.velocity_mps),
            heading_rad=np.where(later, ruin[..., 0], tracks.heading_rad),
            valid=valid,
        )
        same_bits(fitted.label_windows(replace(scene, tracks=ruined), [t0 - 49], 50, span="history"), wanted)
    cut = scene.history(t0, 50)
    same_bits(history_labels(fitted, cut, np.arange(12, dtype=np.int32)), wanted)
    assert history_labels(fitted, cut, 3).agent_id == ("car-3",)


@few
@given(more=st.floats(0, 100), seed=st.integers(0, 5))
def test_a_larger_gap_never_raises_a(more: float, seed: int) -> None:
    from stylesim.labelers.features import FEATURES
    from stylesim.labelers.options import FeatureOptions
    from stylesim.labelers.rows import track_rows

    tdbm = TDBM().fit([traffic(agents=20, frames=120, seed=1)])
    rows = track_rows(traffic(agents=12, frames=120, seed=seed), FeatureOptions())
    wider = rows.value.copy()
    wider[:, FEATURES.index("s_front")] += more
    before, after = tdbm.judge(rows).aggressiveness, tdbm.judge(replace(rows, value=wider)).aggressiveness
    assert (after <= before + 1e-6).all()
