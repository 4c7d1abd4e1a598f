"""Stressors on every simulator: they happen, they are said, and nothing before them is touched."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from stylesim.errors import InputError, MissingDependencyError
from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.scene import Scene
from stylesim.simulation.backend import Backend, open_backend
from stylesim.simulation.plan import EpisodePlan, stressors_of
from stylesim.tracks import AgentKind, TrackFlag

CROWD = Population.load("tdbm_spectrum")
SITES = {"highway": ("highway", 3.0, 20.0), "sumo": ("ramp_merge", 40.0, 30.0)}
HAPPEN = ("hard_brake", "cut_in", "jaywalker", "deer", "stalled")


class Site:
    """One scenario of a backend, shortened."""

    def __init__(self, backend: str) -> None:
        name, warm_up_s, duration_s = SITES[backend]
        self.scenario = load_scenario(name).model_copy(update={"warm_up_s": warm_up_s, "duration_s": duration_s})
        self.backend: Backend = open_backend(backend)

    def happened(self, kind: str) -> tuple[Scene, int]:
        """The first of six episodes in which somebody fitted, and its number."""
        for episode in range(6):
            scene = self.run(kind, episode)
            assert scene.counts[f"stressor.{kind}"] + scene.counts[f"stressor.{kind}.nobody_fitted"] == 1
            if scene.metadata["events"]:
                return scene, episode
        raise AssertionError(f"{kind} finds nobody in six episodes")

    @cache  # noqa: B019 - lives as long as the module's tests
    def run(self, stressors: str, episode: int = 0) -> Scene:
        plan = EpisodePlan(stressors=stressors_of(stressors) if stressors else ())
        return self.backend.run_episode(self.scenario, CROWD, seed=3, episode=episode, plan=plan)


@pytest.fixture(scope="module", params=sorted(SITES))
def site(request: pytest.FixtureRequest) -> Iterator[Site]:
    try:
        made = Site(request.param)
    except (MissingDependencyError, ModuleNotFoundError) as error:
        pytest.skip(f"{request.param} cannot be opened here: {error}")
    yield made
    made.backend.close()


@pytest.mark.parametrize("kind", HAPPEN)
def test_it_happens_and_is_said(site: Site, kind: str) -> None:
    scene, _ = site.happened(kind)
    (event,) = scene.metadata["events"]
    assert (event["kind"], scene.counts[f"stressor.{kind}"]) == (kind, 1)
    tracks = scene.tracks
    actor = tracks.agent_id.index(event["actor"])
    assert TrackFlag.STRESSOR in TrackFlag(int(tracks.flags[actor]))
    if event["victim"] in tracks.agent_id:
        assert TrackFlag.STRESSED in TrackFlag(int(tracks.flags[tracks.agent_id.index(event["victim"])]))
    frame = round(event["time_s"] / tracks.dt_s)
    speed = tracks.speed_mps[actor]
    if kind == "hard_brake":
        braking = -np.diff(speed[frame : frame + 60]) / tracks.dt_s
        assert np.nanmax(braking) == pytest.approx(event["braking_mps2"], abs=1.0)
    if kind == "stalled":
        assert np.nanmin(speed[frame:]) < 0.5 * speed[frame]
    if kind in ("jaywalker", "deer"):
        assert tracks.kind[actor] == (AgentKind.PEDESTRIAN if kind == "jaywalker" else AgentKind.OTHER)
        assert tracks.driver[actor] is None
        assert speed[frame] == pytest.approx(event["speed_mps"], abs=1e-3)
        victim = tracks.speed_mps[tracks.agent_id.index(event["victim"])]
        assert np.nanmin(victim[frame : frame + 60]) < victim[frame] - 1.0  # the driver has braked


@pytest.mark.parametrize("kind", HAPPEN)
def test_nothing_before_it_is_touched(site: Site, kind: str) -> None:
    scene, episode = site.happened(kind)
    plain = site.run("", episode)
    frame = round(scene.metadata["events"][0]["time_s"] / scene.tracks.dt_s)
    one, other = (s.tracks.frames(0, frame) for s in (plain, scene))
    one, other = (tracks.select(tracks.valid.any(axis=1)) for tracks in (one, other))
    assert one.agent_id == other.agent_id
    np.testing.assert_array_equal(one.position_m, other.position_m)
    later = [s.tracks.select(s.tracks.kind != AgentKind.PEDESTRIAN).position_m[:, frame:] for s in (plain, scene)]
    assert later[0].shape != later[1].shape or not np.array_equal(*later, equal_nan=True)


def test_all_at_once_and_again_the_same(site: Site) -> None:
    plan = EpisodePlan(stressors=stressors_of(",".join(HAPPEN)))
    one, two = (site.backend.run_episode(site.scenario, CROWD, seed=3, episode=1, plan=plan) for _ in range(2))
    assert one.metadata == two.metadata
    assert dict(one.counts) == dict(two.counts)
    np.testing.assert_array_equal(one.tracks.position_m, two.tracks.position_m)
    actors = [event["actor"] for event in one.metadata["events"]]
    assert len(set(actors)) == len(actors) >= 2


def test_a_red_runner_needs_a_crossing(site: Site) -> None:
    with pytest.raises(InputError, match="has no crossing"):
        site.run("red_runner")


def test_a_red_runner_runs_red(site: Site) -> None:
    if site.backend.name != "sumo":
        pytest.skip("no scenario with a signal")
    scenario = load_scenario("yellow_light").model_copy(update={"duration_s": 60.0})
    plan = EpisodePlan(stressors=stressors_of("red_runner"))
    scenes = [site.backend.run_episode(scenario, CROWD, seed=3, episode=episode, plan=plan) for episode in range(4)]
    happened = [(scene, event) for scene in scenes for event in scene.metadata["events"]]
    assert happened
    for scene, event in happened:
        flags = TrackFlag(int(scene.tracks.flags[scene.tracks.agent_id.index(event["actor"])]))
        assert TrackFlag.RAN_RED | TrackFlag.STRESSOR in flags
