from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.tracks import AgentKind
from stylesim.windows import WindowSpec, anchor_frames, target_agents
from tests.conftest import make_scene


def test_anchors_leave_a_whole_history_and_a_whole_future():
    assert anchor_frames(make_scene(n_frames=150), WindowSpec(5, 6, 3)) == [49, 79]
    assert anchor_frames(make_scene(n_frames=109), WindowSpec(5, 6, 3)) == []
    fixed = replace(make_scene(n_frames=110), t0_frame=49)
    assert anchor_frames(fixed, WindowSpec(5, 6, 3)) == [49]


def test_targets_are_motor_vehicles_known_for_a_second_and_to_the_end():
    scene = make_scene(n_frames=130)  # the last car is there from frame 32 to 96
    assert target_agents(scene, 49, WindowSpec()).tolist() == [0, 1, 2, 3]
    assert target_agents(scene, 49, WindowSpec(5, 4, 3)).tolist() == [0, 1, 2, 3, 4]
    assert target_agents(scene, 38, WindowSpec(3, 4, 3)).tolist() == [0, 1, 2, 3]
    assert target_agents(scene, 49, WindowSpec(), need_future=False).tolist() == [0, 1, 2, 3, 4]
    kind = np.array([AgentKind.PEDESTRIAN, *scene.tracks.kind[1:]])
    walking = replace(scene, tracks=replace(scene.tracks, kind=kind))
    assert target_agents(walking, 49, WindowSpec()).tolist() == [1, 2, 3]


def test_lengths_must_be_positive():
    with pytest.raises(InputError, match="must be a positive number"):
        WindowSpec(history_s=0)
