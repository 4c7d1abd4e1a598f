"""The parts behind `generate --ego`, and a whole run with it."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.corpus import Corpus
from stylesim.errors import InputError, SimulationError
from stylesim.planners import EgoControl, EgoTrajectory, IdmPlanner
from stylesim.planners.bicycle import LENGTH_M, MAX_LATERAL_MPS2, EgoState, limited, moved
from stylesim.planners.loading import load_planner, planner_source
from stylesim.planners.outcome import crossings, with_ego_track
from stylesim.planners.tracking import control_towards
from stylesim.population import Population
from stylesim.road import Lane, Road
from stylesim.scenario import load_scenario
from stylesim.simulation.backend import open_backend
from stylesim.simulation.generate import generate
from stylesim.simulation.plan import EpisodePlan
from stylesim.tracks import TrackFlag
from tests.conftest import make_scene
from tests.contract import planners as made

CROWD = Population.load("naturalistic")
HERE = "tests.contract.planners"


def test_the_bicycle_drives_the_circle_of_its_steering() -> None:
    state = EgoState(0.0, 0.0, 0.0, 5.0, 0.3)
    for _ in range(2000):
        state = moved(state, EgoControl(0.0, 0.3), dt_s=0.01)
    radius = LENGTH_M / 2 / math.sin(state.slip_rad)
    centre = np.array([-math.sin(0.0 + state.slip_rad), math.cos(state.slip_rad)]) * radius
    assert math.hypot(state.x - centre[0], state.y - centre[1]) == pytest.approx(radius, rel=0.01)


@settings(max_examples=200, deadline=None)
@given(st.floats(-50, 50), st.floats(-3, 3), st.floats(0, 60), st.floats(-0.7, 0.7))
def test_whatever_is_asked_the_car_stays_within_its_limits(
    pedal: float, wheel: float, speed: float, now: float
) -> None:
    state = EgoState(0.0, 0.0, 0.0, speed, now)
    control = limited(EgoControl(pedal, wheel), state, dt_s=0.1).control
    after = moved(state, control, dt_s=0.1)
    assert -8.0 <= control.acceleration_mps2 <= 4.0 or speed < 0.8
    assert 0.0 <= after.speed_mps <= 60.0
    yaw_rate = 2 * speed * math.sin(after.slip_rad) / LENGTH_M
    assert abs(yaw_rate * speed) <= MAX_LATERAL_MPS2 * 1.02 or abs(control.steering_rad) <= abs(now)


@pytest.mark.parametrize("shift", [0.0, 2.0])
def test_a_trajectory_is_driven(shift: float) -> None:
    state = EgoState(0.0, 0.0, 0.0, 8.0)
    for step in range(120):
        times = (step + 1 + np.arange(40)) * 0.1
        goal = np.stack([10.0 * times, shift * np.clip(times / 5.0, 0.0, 1.0)], axis=1)
        state = moved(state, limited(control_towards(EgoTrajectory(goal), state), state, dt_s=0.1).control, dt_s=0.1)
    assert state.x == pytest.approx(120.0, abs=1.0)
    assert state.y == pytest.approx(shift, abs=0.2)
    assert state.speed_mps == pytest.approx(10.0, abs=0.2)


@pytest.mark.parametrize(
    ("position", "dt_s"), [(np.zeros((0, 2)), 0.1), (np.array([[0.0, np.nan]]), 0.1), (np.zeros((3, 2)), 0.0)]
)
def test_a_trajectory_that_is_none_is_refused(position: np.ndarray, dt_s: float) -> None:
    with pytest.raises(ValueError, match="trajectory"):
        EgoTrajectory(position, dt_s)


@pytest.mark.parametrize(
    ("entry_point", "words"),
    [
        ("no colon", "package.module:name"),
        ("os;import sys:x", "package.module:name"),
        ("nowhere.at.all:x", "nowhere"),
        ("nowhere:x", "no module 'nowhere'"),
        (f"{HERE}:coats", "'coast'"),
        (f"{HERE}:NUMBER", "cannot be called"),
    ],
)
def test_a_wrong_entry_point_says_what_is_wrong(entry_point: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_planner(entry_point)


@pytest.mark.parametrize(("name", "words"), [("NeedsArguments", "weights"), ("NotCallable", "__call__")])
def test_a_class_that_cannot_be_a_planner(name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_planner(f"{HERE}:{name}")()


def test_a_module_that_fails_to_import_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_planner.py").write_text("raise OSError('no weights here')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend("")
    with pytest.raises(InputError, match="OSError: no weights here"):
        load_planner("broken_planner:plan")
    assert planner_source("broken_planner:plan") == tmp_path / "broken_planner.py"


def episode(name: str, planner: str, *, warm_up_s: float, duration_s: float, seed: int = 4):
    scenario = load_scenario(name).model_copy(update={"warm_up_s": warm_up_s, "duration_s": duration_s})
    backend = open_backend(scenario.backend)
    try:
        return backend.run_episode(scenario, CROWD, seed=seed, episode=0, plan=EpisodePlan(ego=f"{HERE}:{planner}"))
    finally:
        backend.close()


@pytest.mark.parametrize(("name", "warm_up_s"), [("yellow_light", 30.0), ("highway", 1.0)])
def test_the_planner_sees_the_past_only_and_no_style(name: str, warm_up_s: float) -> None:
    scene = episode(name, "Remembers", warm_up_s=warm_up_s, duration_s=4.0)
    shown = made.Remembers.scenes
    assert len(shown) >= 35
    ego = scene.tracks.agent_id.index("ego")
    for step, seen in enumerate(shown):
        tracks = seen.tracks
        assert tracks.n_frames == min(step + 1, 20)
        assert tracks.agent_id[0] == "ego"
        assert tracks.flags is not None
        assert tracks.flags.tolist() == [int(TrackFlag.EGO)] + [0] * (tracks.n_agents - 1)
        assert all(driver is None for driver in tracks.driver)
        assert seen.road is not None
        assert (seen.signals is not None) == (name == "yellow_light")
        assert not seen.counts and not seen.parameters
    first = 0 if name == "highway" else 1  # SUMO's planner is asked first in the frame before the log
    for step in (5, 30):  # what it was shown as now is what was logged
        now, logged = shown[step + first].tracks.position_m[0, -1], scene.tracks.position_m[ego, step]
        np.testing.assert_allclose(now, logged, atol=1e-3)


@pytest.mark.parametrize(("name", "warm_up_s"), [("motorway", 30.0), ("highway", 1.0)])
def test_others_react_to_the_ego_and_it_stands_where_it_says(name: str, warm_up_s: float) -> None:
    scene = episode(name, "stop", warm_up_s=warm_up_s, duration_s=15.0)
    ego = scene.tracks.agent_id.index("ego")
    assert scene.tracks.speed_mps[ego, -1] == 0.0
    assert scene.counts["ego_collisions"] == 0  # who comes behind brakes or goes around


@pytest.mark.parametrize(("name", "warm_up_s"), [("motorway", 30.0), ("highway", 1.0)])
def test_a_collision_is_kept_and_flagged(name: str, warm_up_s: float) -> None:
    for seed in range(4, 12):  # on a thin motorway it takes a while to catch up with somebody
        scene = episode(name, "ram", warm_up_s=warm_up_s, duration_s=25.0, seed=seed)
        if scene.counts["ego_collisions"]:
            break
    assert scene.counts["ego_collisions"] >= 1
    struck = scene.tracks.flagged(TrackFlag.COLLIDED)
    assert struck[scene.tracks.agent_id.index("ego")]
    assert struck.sum() >= 2
    assert scene.counts["ego_steps_limited"] > 0  # 9 m/s2 is more than the car has


@pytest.mark.parametrize(
    ("planner", "words"),
    [
        (
            "FailsLater",
            r"planner 'tests.contract.planners:FailsLater' at step 10 \(1.0 s\): RuntimeError: no plan left",
        ),
        ("answers_text", "answered a str"),
        ("answers_nan", "finite"),
    ],
)
def test_errors_of_the_planner_are_its_own_with_name_and_step(planner: str, words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        episode("highway", planner, warm_up_s=0.5, duration_s=3.0)


def test_a_red_light_that_is_run_is_seen() -> None:
    scene = make_scene(n_agents=2, n_frames=130)
    x = np.linspace(480.0, 620.0, 130)  # over the end of the lane, at x = 600, while the light is red
    rows = np.stack([np.arange(130.0), x, np.zeros(130), np.full(130, 10.8), np.zeros(130), np.zeros(130)], axis=1)
    rows[:, 1:3] += scene.tracks.origin_m
    joined = with_ego_track(scene, rows)
    assert joined.tracks.agent_id[-1] == "ego"
    np.testing.assert_allclose(joined.tracks.position_m[-1, :, 0], x, atol=1e-2)
    line = scene.road
    assert line is not None
    moved_road = Road(tuple(Lane(lane.lane_id, lane.centre_line_m + scene.tracks.origin_m) for lane in line.lanes))
    assert crossings(replace(joined, road=moved_road), joined.tracks.n_agents - 1) == (1, 0)


def test_the_baseline_follows_its_lane_and_stops_for_red() -> None:
    scenario = load_scenario("yellow_light").model_copy(update={"warm_up_s": 40.0, "duration_s": 110.0})
    backend = open_backend("sumo")
    plan = EpisodePlan(ego="stylesim.planners:IdmPlanner")
    stopped = red = hit = 0
    for number in range(3):
        scene = backend.run_episode(scenario, CROWD, seed=1, episode=number, plan=plan)
        ego = scene.tracks.agent_id.index("ego")
        stopped += bool(np.nanmin(scene.tracks.speed_mps[ego]) < 0.3)
        red += scene.counts["ego_reds_run"]
        hit += scene.counts["ego_collisions"]
    backend.close()
    assert stopped >= 1
    assert red == 0
    assert hit == 0
    with pytest.raises(TypeError):
        IdmPlanner(1)  # made without arguments


def test_generate_with_a_planner_from_the_current_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_planner.py").write_text(
        "from stylesim.planners import EgoControl\n\n\ndef plan(scene):\n    return EgoControl(-1.0, 0.0)\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(made.__file__).parents[2]))
    plan = EpisodePlan(ego="my_planner:plan")
    place = tmp_path / "short"
    place.mkdir()
    text = (Path(made.__file__).parents[2] / "scenarios" / "highway" / "scenario.yaml").read_text()
    (place / "scenario.yaml").write_text(
        text.replace("duration_s: 20.0", "duration_s: 2.0").replace("vehicles: 30", "vehicles: 8")
    )
    for workers in (1, 2):
        generate(
            str(place), "naturalistic", episodes=2, seed=1, out=tmp_path / f"w{workers}", workers=workers, plan=plan
        )
    one, two = ({p.name: p.read_bytes() for p in (tmp_path / w / "tracks").iterdir()} for w in ("w1", "w2"))
    assert one == two
    corpus = Corpus(tmp_path / "w1")
    assert all(scene.tracks.flagged(TrackFlag.EGO).sum() == 1 for scene in corpus)
    assert corpus.manifest["configuration"]["planner_sha256"]
    with pytest.raises(InputError, match="no module 'my_plannner'"):
        generate(
            str(place), "naturalistic", episodes=1, seed=1, out=tmp_path / "x", plan=EpisodePlan(ego="my_plannner:plan")
        )
    with pytest.raises(InputError, match="'plan'"):
        generate(
            str(place), "naturalistic", episodes=1, seed=1, out=tmp_path / "x", plan=EpisodePlan(ego="my_planner:plam")
        )
    assert not (tmp_path / "x").exists()
    assert not (tmp_path / "x.partial").exists()
    sys.modules.pop("my_planner", None)
