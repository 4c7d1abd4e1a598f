"""Episodes in SUMO: determinism, signals, decisions, smooth tracks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stylesim.errors import SimulationError
from stylesim.geometry import wrap_angle
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import load_scenario
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.simulation.sumo.episode import prepare_episode
from stylesim.style import STYLE_CLASSES
from stylesim.tracks import TrackFlag

pytest.importorskip("libsumo", exc_type=ImportError)
from stylesim.simulation.sumo import SumoBackend

SPECTRUM = Population.load("tdbm_spectrum")
YELLOW = load_scenario("yellow_light").model_copy(update={"warm_up_s": 60.0, "duration_s": 90.0})
RAMP = load_scenario("ramp_merge").model_copy(update={"warm_up_s": 25.0, "duration_s": 30.0})


@pytest.fixture(scope="module")
def backend():
    opened = SumoBackend()
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def scenes(backend: SumoBackend) -> list[Scene]:
    runs = ((YELLOW, 0), (YELLOW, 1), (RAMP, 0))
    return [backend.run_episode(scenario, SPECTRUM, seed=7, episode=episode) for scenario, episode in runs]


def test_lights_show_the_drawn_yellow_and_all_red(scenes: list[Scene]) -> None:
    for scene in scenes[:2]:
        assert scene.signals is not None
        lengths = []
        for state in scene.signals.state:
            change = np.flatnonzero(np.diff(state)) + 1
            runs = np.split(state, change)[1:-1]  # whole phases only
            lengths += [len(run) * 0.1 for run in runs if run[0] == SignalState.YELLOW]
        assert lengths
        np.testing.assert_allclose(lengths, round(scene.parameters["yellow_s"], 1), atol=1e-6)
        main = scene.signals.state[scene.signals.lane_id.index(("west_in_0",))]
        side = scene.signals.state[scene.signals.lane_id.index(("south_in_0",))]
        assert not ((main != SignalState.RED) & (side != SignalState.RED)).any()


def test_decisions_come_at_the_onset_and_have_consequences(backend: SumoBackend, tmp_path: Path) -> None:
    files = prepare_episode(YELLOW, SPECTRUM, seed=7, episode=0, folder=tmp_path)
    log, events = backend.simulate(files)
    texts = [log.signals["centre"].texts[index] for index in log.signals["centre"].shown]
    assert events
    for event in events:
        assert "y" in texts[event.step]
        assert "y" not in texts[event.step - 1]
    assert len({(event.step, event.driver_id) for event in events}) == len(events)
    number = {name: index for index, name in enumerate(log.driver_ids)}
    stayed = crossed = 0
    for event in events:
        rows = (log.driver == number[event.driver_id]) & (log.step >= event.step) & (log.step <= event.step + 30)
        if event.stop and event.distance_m > 10.0 and rows.sum() == 31:
            way = np.hypot(*np.diff(log.front_m[rows], axis=0).T).sum()
            stayed += int(way < event.distance_m)
            crossed += int(way >= event.distance_m)
    assert stayed > 0
    assert crossed == 0


def test_tracks_are_smooth_and_consistent(scenes: list[Scene]) -> None:
    for scene in scenes:
        tracks = scene.tracks
        both = tracks.valid[:, 1:] & tracks.valid[:, :-1]
        step = np.diff(tracks.position_m.astype(np.float64), axis=1)
        error = (step / tracks.dt_s - tracks.velocity_mps[:, 1:])[both]
        assert np.abs(error).max() < 5e-3  # float32 positions
        heading = tracks.heading_rad[:, 1:]
        sideways = np.abs(step[..., 1] * np.cos(heading) - step[..., 0] * np.sin(heading))[both]
        assert sideways.max() < 0.15
        moving = tracks.valid & (tracks.speed_mps > 2.0)
        course = np.arctan2(tracks.velocity_mps[..., 1], tracks.velocity_mps[..., 0])
        slip = np.abs(wrap_angle(course - tracks.heading_rad))[moving]
        assert np.quantile(slip, 0.999) < 0.1
        standing = both & (np.hypot(*np.moveaxis(step, -1, 0)) == 0.0)
        # who creeps by less than float32 positions can show may turn by as little
        assert np.abs(np.diff(tracks.heading_rad, axis=1)[standing]).max(initial=0.0) < 1e-6


def test_every_track_is_logged_from_three_seconds_after_entry(backend: SumoBackend, tmp_path: Path) -> None:
    files = prepare_episode(RAMP, SPECTRUM, seed=7, episode=0, folder=tmp_path)
    scene = backend.run_episode(RAMP, SPECTRUM, seed=7, episode=0)
    assert scene.counts["settling_steps_dropped"] > 0
    for agent, name in enumerate(scene.tracks.agent_id):
        first = np.flatnonzero(scene.tracks.valid[agent])[0] * 0.1 + files.warm_up_s
        assert first >= files.drivers[name].depart_s + 3.0 - 1e-6


def test_style_shares_are_realised(tmp_path: Path) -> None:
    crowd = Population.of(aggressive=0.3, timid=0.7)
    names = [
        driver.style.name
        for episode in range(6)
        for driver in prepare_episode(YELLOW, crowd, seed=1, episode=episode, folder=tmp_path).drivers.values()
    ]
    assert set(names) <= set(STYLE_CLASSES)
    assert names.count("aggressive") / len(names) == pytest.approx(0.3, abs=0.12)
    assert names.count("aggressive") + names.count("timid") == len(names)


def test_another_population_moves_no_departure(tmp_path: Path) -> None:
    files = prepare_episode(YELLOW, SPECTRUM, seed=3, episode=4, folder=tmp_path)
    one, limit = files.drivers, files.parameters["speed_limit_mps"]
    other = prepare_episode(YELLOW, Population.load("naturalistic"), seed=3, episode=4, folder=tmp_path).drivers
    assert [(d.depart_s, d.route, d.length_m) for d in one.values()] == [
        (d.depart_s, d.route, d.length_m) for d in other.values()
    ]
    assert [d.style for d in one.values()] != [d.style for d in other.values()]
    first = next(iter(one))
    assert one[first].style == SPECTRUM.draw(stream(3, 4, first, "style"), backend="sumo", limit_mps=limit)


def test_flags_agree_with_counts(scenes: list[Scene]) -> None:
    for scene in scenes:
        for flag in (TrackFlag.DECIDED_STOP, TrackFlag.RAN_RED, TrackFlag.COLLIDED):
            assert scene.counts[str(flag.name).lower()] == int(scene.tracks.flagged(flag).sum())
    assert scenes[0].counts["decided_stop"] > 0
    assert scenes[0].counts["stopped_at_line"] > 0


def test_a_second_simulation_in_this_process_is_refused(backend: SumoBackend, scenes: list[Scene]) -> None:
    other = SumoBackend()
    with pytest.raises(SimulationError, match="one simulation per process"):
        other.run_episode(RAMP, SPECTRUM, seed=0, episode=0)
    again = backend.run_episode(RAMP, SPECTRUM, seed=7, episode=0)
    np.testing.assert_array_equal(again.tracks.position_m, scenes[2].tracks.position_m)


def test_an_episode_without_traffic_is_an_empty_scene(backend: SumoBackend) -> None:
    scenario = RAMP.model_copy(update={"warm_up_s": 0.0, "duration_s": 1.0})
    scene = backend.run_episode(scenario, SPECTRUM, seed=7, episode=0)
    assert scene.tracks.n_agents == 0
    assert scene.tracks.n_frames == 10
