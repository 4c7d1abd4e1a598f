from __future__ import annotations

from dataclasses import replace

import numpy as np

from stylesim.forecasting.snapshot import STATE_VALID, agent_arrays, evidence, lane_signals, road_arrays
from stylesim.road import Lane, LaneEvidence, Road
from stylesim.signals import Signals, SignalState
from tests.conftest import make_scene

from .made import INPUTS


def test_only_agents_known_at_t0_and_short_histories_padded_on_the_left() -> None:
    scene = make_scene(n_frames=80)  # the last car comes at frame 20 and leaves at 60
    arrays = agent_arrays(scene.history(24, INPUTS.history_steps), INPUTS)
    assert arrays.row.tolist() == [0, 1, 2, 3, 4]
    assert arrays.state[4, :, STATE_VALID].tolist() == [0.0] * 15 + [1.0] * 5
    assert (arrays.state[4, :15] == 0).all()
    assert np.isfinite(arrays.state).all()
    later = agent_arrays(scene.history(70, INPUTS.history_steps), INPUTS)
    assert later.row.tolist() == [0, 1, 2, 3, -1]
    early = agent_arrays(scene.history(4, INPUTS.history_steps), INPUTS)
    assert early.state[0, :, STATE_VALID].tolist() == [0.0] * 15 + [1.0] * 5


def test_lanes_are_cut_into_pieces_that_join() -> None:
    scene = make_scene()
    assert scene.road is not None
    road = road_arrays(scene.road, INPUTS)
    first = road.points_m[road.lane == 0]
    assert len(first) == np.ceil(650 / INPUTS.piece_m)
    np.testing.assert_allclose(first[:-1, -1], first[1:, 0], atol=1e-4)
    np.testing.assert_allclose(first[0, 0], [-50, 0], atol=1e-4)
    np.testing.assert_allclose(first[-1, -1], [600, 0], atol=1e-4)
    np.testing.assert_allclose(road.middle_m, road.points_m.mean(axis=1), atol=1e-3)


def test_a_driver_is_left_out_of_the_line_inferred_from_him() -> None:
    line = np.stack([np.linspace(0, 30, 4), np.zeros(4)], axis=1)
    offset = np.array([[2.0] * 4, [-1.0] * 4], np.float32)
    road = Road((Lane("a", line, evidence=LaneEvidence(("me", "other"), offset)),), source="inferred")
    assert evidence(road) == {"me", "other"}
    np.testing.assert_allclose(road_arrays(road, INPUTS, without="me").points_m[..., 1], -1.0, atol=1e-5)
    np.testing.assert_allclose(road_arrays(road, INPUTS).points_m[..., 1], 0.0, atol=1e-5)


def test_lights_tell_their_state_and_for_how_long() -> None:
    scene = make_scene(n_frames=80)
    state = np.full((3, 80), SignalState.GREEN)
    state[1, 36:] = SignalState.YELLOW
    state[2, :] = SignalState.UNKNOWN
    lights = Signals(("a", "b", "c"), (("right",), ("left", "nowhere"), ("right",)), state)
    history = replace(scene, signals=lights).history(40, INPUTS.history_steps)
    assert history.road is not None
    assert history.signals is not None
    found = lane_signals(history.road, history.signals, INPUTS)
    np.testing.assert_allclose(found, [[SignalState.GREEN, 2.0], [SignalState.YELLOW, 0.5]], atol=1e-6)


def test_of_two_lights_on_a_lane_the_stricter_counts() -> None:
    scene = make_scene(n_frames=80)
    state = np.stack([np.full(80, SignalState.RED), np.full(80, SignalState.GREEN)])
    lights = Signals(("a", "b"), (("right",), ("right",)), state)
    assert scene.road is not None
    assert lane_signals(scene.road, lights, INPUTS)[:, 0].tolist() == [SignalState.RED, SignalState.UNKNOWN]
