from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.labelers import rows
from stylesim.labelers.features import joint_features, window_features
from stylesim.labelers.options import FeatureOptions
from stylesim.road import LaneEvidence, Road
from stylesim.scene import Scene

from .made import traffic


def gappy(seed: int = 0) -> Scene:
    """Traffic with holes, values that lean on later frames, agents that come and go, on an inferred road."""
    scene = traffic(agents=25, frames=170, seed=seed)
    tracks, rng = scene.tracks, np.random.default_rng(seed)
    valid = rng.random(tracks.valid.shape) > 0.02
    for agent in range(0, 25, 3):
        valid[agent, : rng.integers(0, 120)] = False
        valid[agent + 1 if agent < 24 else 0, rng.integers(60, 170) :] = False
    hidden = ~valid
    moved = replace(
        tracks,
        valid=valid,
        position_m=np.where(hidden[..., None], np.nan, tracks.position_m),
        velocity_mps=np.where(hidden[..., None], np.nan, tracks.velocity_mps),
        heading_rad=np.where(hidden, np.nan, tracks.heading_rad),
        lookahead_steps=rng.choice([0, 0, 0, 4], valid.shape).astype(np.int16),
    )
    assert scene.road is not None
    evidence = LaneEvidence(tuple(f"car-{i}" for i in range(9)), rng.normal(0, 0.3, (9, 2)).astype(np.float32))
    lanes = tuple(replace(lane, evidence=evidence, speed_limit_mps=float("nan")) for lane in scene.road.lanes)
    return replace(scene, tracks=moved, road=Road(lanes, source="inferred"))


def test_histories_worked_out_together_have_the_bits_of_each_alone() -> None:
    scene, options = gappy(), FeatureOptions()
    histories = [scene.history(t0, 50) for t0 in (49, 60, 79, 130, 169)]
    joint = joint_features(histories, options)
    for window, history in enumerate(histories):
        alone = window_features(history, 0, 50, options)
        for name in ("value", "frames", "highway", "flags"):
            np.testing.assert_array_equal(getattr(joint, name)[:, window], getattr(alone, name)[:, 0], err_msg=name)
    assert len(np.unique(joint.flags)) > 2
    assert np.isfinite(joint.column("s_center")).mean() > 0.5


def test_batches_and_short_histories_do_not_change_the_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, options = gappy(1), FeatureOptions()
    starts = [-30, -10, 0, 7, 100, 120]
    wanted = rows.concatenated([rows.history_rows(scene, [start], 50, options) for start in starts])
    for cells in (1, 3 * 25 * 50, 1 << 20):
        monkeypatch.setattr(rows, "CELLS", cells)
        found = rows.history_rows(scene, starts, 50, options)
        np.testing.assert_array_equal(found.value, wanted.value)
        np.testing.assert_array_equal(found.flags, wanted.flags)
        np.testing.assert_array_equal(found.stop_frame, wanted.stop_frame)
        assert found.agent_id == wanted.agent_id


def test_scenes_that_do_not_fit_together_are_refused() -> None:
    scene = gappy()
    with pytest.raises(ValueError, match="one road, length"):
        joint_features([scene.history(60, 50), scene.history(60, 40)], FeatureOptions())
