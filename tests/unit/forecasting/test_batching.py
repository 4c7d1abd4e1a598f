from __future__ import annotations

from dataclasses import replace

import numpy as np

from stylesim.forecasting.batching import Batch, gather, to_scene, to_target
from stylesim.forecasting.config import InputConfig
from stylesim.forecasting.samples import RoadCutter, add_window
from stylesim.forecasting.store import MemorySink, StoreBuilder
from stylesim.scene import Scene
from tests.conftest import make_scene

from .made import INPUTS


def batch_of(scene: Scene, t0: int, targets: list[int], config: InputConfig = INPUTS) -> Batch:
    sink = MemorySink(config)
    history = scene.history(t0, config.history_steps)
    rows = add_window(StoreBuilder(sink), RoadCutter(config), history, np.array(targets, np.int32), config)
    sink.append("sample", rows)
    return gather(sink.store(), np.arange(len(targets)), config)


def test_the_target_is_agent_0_at_the_origin_heading_along_x() -> None:
    batch = batch_of(make_scene(n_agents=7), 40, [3, 0])
    np.testing.assert_allclose(batch.agent[:, 0, -1, :2], 0.0, atol=1e-6)
    np.testing.assert_allclose(batch.agent[:, 0, -1, 4:6], [[1, 0], [1, 0]], atol=1e-6)
    assert (batch.agent[:, 0, -1, 2] > 5).all()
    assert (batch.agent_attribute[:, 0, 2] == 1).all()
    assert (batch.agent_attribute[:, 1:, 2] == 0).all()


def test_the_nearest_agents_are_kept() -> None:
    scene = make_scene(n_agents=20)
    few = replace(INPUTS, agents=4)
    batch = batch_of(scene, 40, [0], few)
    here = scene.tracks.position_m[:, 40]
    distance = np.sort(np.hypot(*(here - here[0]).T))[:4]
    np.testing.assert_allclose(np.hypot(*batch.agent[0, :, -1, :2].T), distance, atol=1e-4)


def test_what_does_not_exist_is_zero_and_marked() -> None:
    scene = replace(make_scene(n_agents=3), road=None, signals=None)
    batch = batch_of(scene, 40, [0, 1])
    assert batch.agent_valid.sum(axis=1).tolist() == [3, 3]
    assert not batch.piece_valid.any()
    assert (batch.agent[:, 3:] == 0).all()
    assert (batch.piece == 0).all()
    assert (batch.piece_attribute == 0).all()


def test_pieces_carry_the_light_of_their_lane() -> None:
    scene = make_scene(n_frames=130)
    for t0, state in ((40, 2), (70, 3), (120, 4)):
        light = batch_of(scene, t0, [0]).piece_attribute[0, :, 8:13]
        assert (light.argmax(axis=1) == state).all()
    dark = batch_of(replace(scene, signals=None), 40, [0]).piece_attribute[0, :, 8:13]
    assert (dark.argmax(axis=1) == 0).all()


def test_agents_on_one_spot_do_not_take_the_targets_place() -> None:
    scene = make_scene(n_agents=4)
    position = scene.tracks.position_m.copy()
    position[1] = position[2]
    crowded = replace(scene, tracks=replace(scene.tracks, position_m=position))
    batch = batch_of(crowded, 40, [1, 2])
    speed = scene.tracks.speed_mps[[1, 2], 40]
    np.testing.assert_allclose(np.hypot(*batch.agent[:, 0, -1, 2:4].T), speed, rtol=1e-5)
    assert (batch.agent_valid.sum(axis=1) == 4).all()


def test_to_scene_undoes_to_target() -> None:
    rng = np.random.default_rng(0)
    path = rng.normal(0, 50, (4, 3, 10, 2)).astype(np.float32)
    pose = rng.normal(0, 2, (4, 3)).astype(np.float32)
    there = to_target(path - pose[:, None, None, :2], pose[:, 2])
    np.testing.assert_allclose(to_scene(there, pose), path, atol=1e-4)
