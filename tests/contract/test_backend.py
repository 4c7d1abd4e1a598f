"""What every backend must keep: run it on your own by adding your backend's name and a scenario to CASES."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from stylesim.errors import MissingDependencyError
from stylesim.population import Population
from stylesim.scenario import Scenario, load_scenario, scenarios
from stylesim.scene import Scene
from stylesim.simulation.backend import Backend, open_backend
from stylesim.style import STYLE_CLASSES

CASES = scenarios()
SHORT_S = {"sumo": (20.0, 10.0)}  # warm-up and log; SUMO's roads are empty at first
CROWD = Population.load("tdbm_spectrum")


def short(name: str) -> Scenario:
    scenario = load_scenario(name)
    warm_up_s, duration_s = SHORT_S.get(scenario.backend, (0.5, 1.5))
    return scenario.model_copy(update={"warm_up_s": min(warm_up_s, scenario.warm_up_s), "duration_s": duration_s})


@pytest.fixture(scope="module", params=CASES)
def case(request: pytest.FixtureRequest) -> Iterator[tuple[Scenario, Backend, Scene]]:
    scenario = short(request.param)
    try:
        backend = open_backend(scenario.backend)
    except (MissingDependencyError, ModuleNotFoundError) as error:
        pytest.skip(f"backend {scenario.backend!r} cannot be opened here: {error}")
    yield scenario, backend, backend.run_episode(scenario, CROWD, seed=5, episode=2)
    backend.close()


def test_keeps_the_protocol(case: tuple[Scenario, Backend, Scene]) -> None:
    scenario, backend, _ = case
    assert isinstance(backend, Backend)
    assert backend.name == scenario.backend


def test_scene_is_whole(case: tuple[Scenario, Backend, Scene]) -> None:
    scenario, _, scene = case
    tracks = scene.tracks
    assert scene.scene_id == scene.unit_id
    assert scene.scenario == scenario.name
    assert tracks.n_frames == round(scenario.duration_s / tracks.dt_s)
    assert tracks.n_agents > 0
    assert tracks.valid.any(axis=1).all()
    assert set(scene.parameters) == set(scenario.parameters)
    assert scene.road is not None
    assert all(style is not None and style.name in STYLE_CLASSES for style in tracks.driver)
    assert (tracks.size_m > 0).all()


def test_missing_is_nan_and_present_is_finite(case: tuple[Scenario, Backend, Scene]) -> None:
    tracks = case[2].tracks
    for values in (tracks.position_m, tracks.velocity_mps, tracks.heading_rad[..., None]):
        np.testing.assert_array_equal(np.isfinite(values).all(axis=-1), tracks.valid)
        assert np.isnan(values[~tracks.valid]).all()


def test_the_same_seed_gives_the_same_scene(case: tuple[Scenario, Backend, Scene]) -> None:
    scenario, backend, scene = case
    backend.run_episode(scenario, CROWD, seed=5, episode=3)  # what ran before must not matter
    again = backend.run_episode(scenario, CROWD, seed=5, episode=2)
    assert again.tracks.agent_id == scene.tracks.agent_id
    assert again.tracks.driver == scene.tracks.driver
    assert dict(again.counts) == dict(scene.counts)
    for name in ("position_m", "velocity_mps", "heading_rad", "flags"):
        np.testing.assert_array_equal(getattr(again.tracks, name), getattr(scene.tracks, name))
    if scene.signals is not None:
        assert again.signals is not None
        np.testing.assert_array_equal(again.signals.state, scene.signals.state)


def test_another_seed_or_episode_gives_another_scene(case: tuple[Scenario, Backend, Scene]) -> None:
    scenario, backend, scene = case
    for seed, episode in ((6, 2), (5, 3)):
        other = backend.run_episode(scenario, CROWD, seed=seed, episode=episode)
        assert other.scene_id != scene.scene_id
        same = other.tracks.position_m.shape == scene.tracks.position_m.shape
        assert not (same and np.array_equal(other.tracks.position_m, scene.tracks.position_m, equal_nan=True))


def test_velocity_is_the_derivative_of_position(case: tuple[Scenario, Backend, Scene]) -> None:
    tracks = case[2].tracks
    both = tracks.valid[:, 1:] & tracks.valid[:, :-1]
    rate = np.diff(tracks.position_m.astype(np.float64), axis=1) / tracks.dt_s
    middle = (tracks.velocity_mps[:, 1:] + tracks.velocity_mps[:, :-1]) / 2
    assert np.abs((rate - middle)[both]).max() < 1.0


def test_can_be_used_again_after_close(case: tuple[Scenario, Backend, Scene]) -> None:
    scenario, backend, scene = case
    backend.close()
    backend.close()
    again = backend.run_episode(scenario, CROWD, seed=5, episode=2)
    np.testing.assert_array_equal(again.tracks.position_m, scene.tracks.position_m)
