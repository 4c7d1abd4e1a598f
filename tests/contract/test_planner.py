"""What every planner must keep.

Run it on your own: `STYLESIM_PLANNER=pkg.module:name pytest tests/contract/test_planner.py`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np
import pytest

from stylesim.errors import MissingDependencyError
from stylesim.planners.answers import EGO_ID
from stylesim.population import Population
from stylesim.scenario import Scenario, load_scenario
from stylesim.scene import Scene
from stylesim.simulation.backend import Backend, open_backend
from stylesim.simulation.plan import EpisodePlan
from stylesim.tracks import TrackFlag

OURS = ("stylesim.planners:IdmPlanner", "tests.contract.planners:straight_trajectory")
PLANNERS = tuple(filter(None, (os.environ.get("STYLESIM_PLANNER"),))) or OURS
PLACES = {"ramp_merge": (30.0, 8.0), "yellow_light": (30.0, 10.0), "highway": (0.5, 3.0), "intersection": (2.0, 4.0)}
CROWD = Population.load("naturalistic")


def short(name: str) -> Scenario:
    warm_up_s, duration_s = PLACES[name]
    return load_scenario(name).model_copy(update={"warm_up_s": warm_up_s, "duration_s": duration_s})


@pytest.fixture(scope="module", params=[(planner, place) for planner in PLANNERS for place in PLACES], ids=str)
def driven(request: pytest.FixtureRequest) -> Iterator[tuple[Scenario, Backend, EpisodePlan, Scene]]:
    planner, place = request.param
    scenario, plan = short(place), EpisodePlan(ego=planner)
    try:
        backend = open_backend(scenario.backend)
    except (MissingDependencyError, ModuleNotFoundError) as error:
        pytest.skip(f"backend {scenario.backend!r} cannot be opened here: {error}")
    yield scenario, backend, plan, backend.run_episode(scenario, CROWD, seed=4, episode=1, plan=plan)
    backend.close()


def test_the_ego_is_in_the_tracks_and_flagged(driven: tuple[Scenario, Backend, EpisodePlan, Scene]) -> None:
    _, _, plan, scene = driven
    tracks = scene.tracks
    assert tracks.agent_id.count(EGO_ID) == 1
    ego = tracks.agent_id.index(EGO_ID)
    assert tracks.flagged(TrackFlag.EGO).tolist() == [i == ego for i in range(tracks.n_agents)]
    assert tracks.driver[ego] is None
    assert scene.metadata["ego"] == {"planner": plan.ego}
    assert scene.counts["ego_steps"] > 10


def test_it_moves_as_a_car_can(driven: tuple[Scenario, Backend, EpisodePlan, Scene]) -> None:
    tracks = driven[3].tracks
    ego = tracks.agent_id.index(EGO_ID)
    valid = tracks.valid[ego]
    assert valid[: int(valid.sum())].all()  # from the first frame on without a gap
    speed, place = tracks.speed_mps[ego][valid].astype(float), tracks.position_m[ego][valid].astype(float)
    heading, v = tracks.heading_rad[ego][valid].astype(float), tracks.velocity_mps[ego][valid].astype(float)
    if tracks.flagged(TrackFlag.COLLIDED)[ego]:
        pytest.skip("the ego has crashed, and highway-env pushes who crash")
    assert speed.min() >= 0
    acceleration = np.diff(speed) / tracks.dt_s
    assert acceleration.max() <= 4.0 + 0.05
    assert acceleration.min() >= -8.0 - 0.05
    np.testing.assert_allclose(np.diff(place, axis=0) / tracks.dt_s, (v[1:] + v[:-1]) / 2, atol=0.6)
    sliding = -np.sin(heading) * v[:, 0] + np.cos(heading) * v[:, 1]
    assert np.abs(sliding).max() <= 0.45 * speed.max() + 1e-3  # slip of the centre at the largest lock
    turn = np.abs(np.remainder(np.diff(heading) + np.pi, 2 * np.pi) - np.pi) / tracks.dt_s
    assert (turn * speed[1:]).max() <= 9.0  # v times yaw rate: what tyres hold, and half a step


def test_the_same_seed_gives_the_same_scene(driven: tuple[Scenario, Backend, EpisodePlan, Scene]) -> None:
    scenario, backend, plan, scene = driven
    again = backend.run_episode(scenario, CROWD, seed=4, episode=1, plan=plan)
    assert dict(again.counts) == dict(scene.counts)
    assert again.tracks.agent_id == scene.tracks.agent_id
    np.testing.assert_array_equal(again.tracks.position_m, scene.tracks.position_m)
    np.testing.assert_array_equal(again.tracks.flags, scene.tracks.flags)
