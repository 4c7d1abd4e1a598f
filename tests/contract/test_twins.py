"""Counterfactual twins in every scenario: the past is the same to the last bit, for everyone; the future is not."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from stylesim.errors import MissingDependencyError
from stylesim.population import Population
from stylesim.scenario import load_scenario, scenarios
from stylesim.scene import Scene
from stylesim.simulation.backend import Backend, open_backend
from stylesim.simulation.plan import EpisodePlan, Twin, TwinRequest
from stylesim.simulation.twins import twins_of

CROWD = Population.load("tdbm_spectrum")
WARM_UP_S = {"sumo": 25.0, "highway": 1.0}  # SUMO's roads are empty at first
AT_S = 3.0
ALWAYS = ("highway", "hw_merge", "intersection", "ramp_merge", "yellow_light")  # one of each kind of traffic
CASES = [name if name in ALWAYS else pytest.param(name, marks=pytest.mark.slow) for name in scenarios()]


class Episodes:
    """The episodes of one scenario, shortened."""

    def __init__(self, name: str) -> None:
        scenario = load_scenario(name)
        warm_up_s = min(WARM_UP_S[scenario.backend], scenario.warm_up_s)
        self.scenario = scenario.model_copy(update={"warm_up_s": warm_up_s, "duration_s": 9.0})
        self.backend: Backend = open_backend(scenario.backend)
        self.base = self.run(EpisodePlan())

    def run(self, plan: EpisodePlan) -> Scene:
        return self.backend.run_episode(self.scenario, CROWD, seed=5, episode=1, plan=plan)

    @cache  # noqa: B019 - lives as long as the module's tests
    def twins(self, at_s: float | None) -> tuple[tuple[Twin, Scene], ...]:
        planned = twins_of(self.base, TwinRequest(at_s=at_s), CROWD, backend=self.scenario.backend, seed=5, episode=1)
        assert [twin.name for twin in planned] == ["twin", "null"]
        return tuple((twin, self.run(EpisodePlan(twin=twin))) for twin in planned)


@pytest.fixture(scope="module", params=CASES)
def episodes(request: pytest.FixtureRequest) -> Iterator[Episodes]:
    try:
        made = Episodes(request.param)
    except (MissingDependencyError, ModuleNotFoundError) as error:
        pytest.skip(f"{request.param} cannot be run here: {error}")
    yield made
    made.backend.close()


def same_until(one: Scene, other: Scene, stop: int) -> bool:
    """True where the frames before `stop` agree to the last bit, for everyone who is in them."""
    cut = [scene.tracks.frames(0, stop) for scene in (one, other)]
    cut = [tracks.select(tracks.valid.any(axis=1)) for tracks in cut]
    return cut[0].agent_id == cut[1].agent_id and all(
        np.array_equal(getattr(cut[0], name), getattr(cut[1], name), equal_nan=name != "valid")
        for name in ("position_m", "velocity_mps", "heading_rad", "valid")
    )


def test_the_past_is_the_same_and_the_future_differs(episodes: Episodes) -> None:
    moment = round(AT_S / episodes.base.tracks.dt_s)
    for twin, scene in episodes.twins(AT_S):
        assert (scene.twin_of, scene.unit_id) == (episodes.base.scene_id, episodes.base.unit_id)
        assert same_until(episodes.base, scene, moment + 1), twin.name
        assert not same_until(episodes.base, scene, scene.tracks.n_frames), twin.name
        if scene.signals is not None and episodes.base.signals is not None:
            np.testing.assert_array_equal(scene.signals.state, episodes.base.signals.state)
        style = scene.tracks.driver[scene.tracks.agent_id.index(twin.driver)]
        assert style == twin.style


def test_from_the_start_only_one_driver_has_another_style(episodes: Episodes) -> None:
    (twin, scene), (_, null) = episodes.twins(None)
    base = dict(zip(episodes.base.tracks.agent_id, episodes.base.tracks.driver, strict=True))
    for agent, style in zip(scene.tracks.agent_id, scene.tracks.driver, strict=True):
        if agent in base:
            assert style == (twin.style if agent == twin.driver else base[agent])
    assert dict(scene.parameters) == dict(null.parameters) == dict(episodes.base.parameters)
    assert not same_until(episodes.base, scene, scene.tracks.n_frames)
    assert not same_until(episodes.base, null, null.tracks.n_frames)


def test_a_twin_is_the_same_whenever_it_is_made(episodes: Episodes) -> None:
    (twin, first), _ = episodes.twins(AT_S)
    again = episodes.run(EpisodePlan(twin=twin))
    assert same_until(first, again, first.tracks.n_frames)
    assert dict(first.counts) == dict(again.counts)
