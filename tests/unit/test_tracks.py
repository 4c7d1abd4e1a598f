from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.arrays import frozen
from stylesim.road import Lane, LaneEvidence
from stylesim.tracks import TrackFlag
from tests.conftest import make_scene


def test_arrays_are_frozen_copies():
    valid = np.ones((5, 130), bool)
    tracks = replace(make_scene().tracks, valid=valid)
    valid[:] = False
    assert tracks.valid.all()
    with pytest.raises(ValueError, match="read-only"):
        tracks.position_m[0, 0, 0] = 1.0


def test_wrong_shapes_and_duplicate_ids_are_refused():
    tracks = make_scene().tracks
    with pytest.raises(Exception, match=r"heading_rad|shape"):  # the runtime type check is on here, and says it first
        replace(tracks, heading_rad=np.zeros((5, 3)))
    with pytest.raises(ValueError, match="flags has shape"):
        frozen(np.zeros(3), np.int32, (5,), "flags")
    with pytest.raises(ValueError, match="duplicates"):
        replace(tracks, agent_id=("a",) * 5)


def test_history_knows_nothing_later_and_nobody_by_style():
    scene = make_scene()
    past = scene.history(49, 50)
    assert past.tracks.n_frames == 50
    assert past.tracks.driver == (None,) * 5
    assert not past.tracks.flags.any()
    assert past.signals.state.shape == (1, 50)
    assert not past.counts
    assert not past.parameters
    np.testing.assert_array_equal(past.tracks.position_m, scene.tracks.position_m[:, :50])


def test_values_interpolated_across_t0_are_hidden_from_the_history():
    scene = make_scene()
    ahead = np.zeros((5, 130), np.int16)
    ahead[0, 45:50] = [5, 4, 3, 2, 1]  # a gap that was bridged with the detection at frame 50
    tracks = replace(scene.tracks, lookahead_steps=ahead)
    assert not tracks.history(49, 50).valid[0, 45:].any()
    assert tracks.history(49, 50).valid[0, :45].all()
    assert tracks.history(50, 51).valid[0].all()
    assert np.isnan(tracks.history(49, 50).position_m[0, 45:]).all()


def test_selecting_agents_keeps_everything_of_them():
    tracks = replace(make_scene().tracks, flags=np.arange(5))
    two = tracks.select(np.array([False, True, False, True, False]))
    assert two.agent_id == ("car-1", "car-3")
    assert two.driver == (tracks.driver[1], tracks.driver[3])
    assert two.flagged(TrackFlag.COLLIDED).tolist() == [True, True]


def test_a_driver_is_left_out_of_its_own_centre_line():
    line = np.stack([np.arange(5.0), np.zeros(5)], axis=1)
    offsets = np.array([[0.0] * 5, [0.2] * 5, [3.0] * 5, [np.nan, 0.4, 0.4, 0.4, 0.4]])
    lane = Lane("a", line, evidence=LaneEvidence(("x", "y", "odd", "z"), offsets))
    np.testing.assert_allclose(lane.without("odd").centre_line_m[:, 1], [0.1, 0.2, 0.2, 0.2, 0.2], atol=1e-6)
    assert lane.without("stranger") is lane
