"""Episodes of both layouts: complete, consistent, reproducible, in our frame."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("highway_env")

from stylesim.errors import InputError
from stylesim.geometry import project, wrap_angle
from stylesim.plausibility import implausible
from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.simulation.backend import Backend
from stylesim.simulation.highway import HighwayBackend
from stylesim.simulation.highway.log import TrackLog
from stylesim.simulation.highway.spec import options_of
from stylesim.simulation.highway.traffic import Crew, highway_traffic
from stylesim.tracks import TrackFlag

POPULATION = Population.load("tdbm_spectrum")


def short(name, *, duration_s=6.0, **options):
    scenario = load_scenario(name)
    changed = {"duration_s": duration_s, "warm_up_s": 2.0, "options": {**scenario.options, **options}}
    return scenario.model_copy(update=changed)


def episode(name, number=0, **options):
    return HighwayBackend().run_episode(short(name, **options), POPULATION, seed=5, episode=number)


@pytest.fixture(scope="module", params=["highway", "intersection"])
def scene(request):
    return episode(request.param, vehicles=16) if request.param == "highway" else episode("intersection")


def test_it_is_a_backend():
    assert isinstance(HighwayBackend(), Backend)


def test_every_car_has_a_style_and_an_id(scene):
    assert scene.tracks.n_agents > 5
    assert all(driver is not None for driver in scene.tracks.driver)
    assert scene.scene_id == f"{scene.scenario}-5-00000"
    assert scene.source == "highway_env"


def test_newcomers_of_the_intersection_are_styled_and_come_late():
    scene = episode("intersection", duration_s=8.0)
    late = ~scene.tracks.valid[:, 0]
    assert late.any()
    assert all(driver is not None for driver in scene.tracks.driver)
    assert len({driver.time_headway_s for driver in scene.tracks.driver if driver}) == scene.tracks.n_agents


def test_numbers_are_finite_exactly_where_valid(scene):
    tracks = scene.tracks
    assert tracks.n_frames == 60
    for values in (tracks.position_m[..., 0], tracks.velocity_mps[..., 1], tracks.heading_rad):
        assert np.array_equal(np.isfinite(values), tracks.valid)
    assert (np.abs(tracks.heading_rad[tracks.valid]) <= np.pi + 1e-5).all()


def test_place_velocity_and_heading_agree(scene):
    tracks = scene.tracks
    sound = ~tracks.flagged(TrackFlag.COLLIDED)
    assert not implausible(tracks.select(sound)).agents.any()
    moved = np.diff(tracks.position_m.astype(np.float64), axis=1) / tracks.dt_s
    meant = (tracks.velocity_mps[:, 1:] + tracks.velocity_mps[:, :-1]) / 2
    both = tracks.valid[:, 1:] & tracks.valid[:, :-1] & sound[:, None]
    assert np.linalg.norm(moved - meant, axis=-1)[both].max() < 0.5
    course = np.arctan2(tracks.velocity_mps[..., 1], tracks.velocity_mps[..., 0])
    fast = tracks.valid & (tracks.speed_mps > 2)
    assert np.abs(wrap_angle(course - tracks.heading_rad))[fast].max() < 0.45  # the slip of locked wheels is 0.40


def test_the_same_seed_gives_the_same_scene_and_another_episode_another(scene):
    again = episode(scene.scenario, vehicles=16) if scene.scenario == "highway" else episode("intersection")
    assert again.tracks.position_m.tobytes() == scene.tracks.position_m.tobytes()
    assert again.tracks.driver == scene.tracks.driver
    assert dict(again.parameters) == dict(scene.parameters)
    other = episode(scene.scenario, 1, duration_s=0.2)
    assert other.tracks.driver[0] != scene.tracks.driver[0]


def test_cars_drive_along_their_lanes_and_on_the_right_side(scene):
    tracks = scene.tracks
    for agent, frames in enumerate(tracks.valid):
        place = tracks.position_m[agent, frames.argmax()].astype(np.float64)
        angle = float(tracks.heading_rad[agent, frames.argmax()])
        distance = [
            project(place[None], lane.centre_line_m)[2][0]
            for lane in scene.road.lanes
            if abs(np.cos((_heading(lane) - angle) / 2)) > np.cos(0.5)
        ]
        assert min(distance) < 3.0  # the lane of the other direction is 4 m away


def _heading(lane):
    step = lane.centre_line_m[1] - lane.centre_line_m[0]
    return float(np.arctan2(step[1], step[0]))


def test_left_is_left():
    scene = episode("highway", vehicles=6, duration_s=0.2)
    for lane in scene.road.lanes:
        if lane.left_neighbour:
            left = scene.road.lane(lane.left_neighbour)
            assert left.centre_line_m[0, 1] - lane.centre_line_m[0, 1] == pytest.approx(4.0)
            assert left.right_neighbour == lane.lane_id
        assert lane.left_boundary_m[0, 1] > lane.centre_line_m[0, 1] > lane.right_boundary_m[0, 1]


def test_collided_cars_are_flagged_and_removed_after_a_while():
    options = options_of(short("highway", vehicles=3, crashed_stay_s=1.0))
    drawn = {"lanes": 1.0, "speed_limit_mps": 20.0, "density_per_km_lane": 10.0}
    traffic = highway_traffic(options, drawn, Crew(POPULATION, seed=1, episode=0), time_s=10.0)
    rear, middle, front = traffic.road.vehicles
    middle.position = rear.position + np.array([3.0, 0.0])
    log = TrackLog(30, 0.1)
    for _ in range(30):
        log.add(traffic.road.vehicles)
        traffic.advance()
        traffic.advance()
    tracks = log.tracks(set(traffic.removed))
    assert traffic.removals() == {"crashed": 2}
    assert traffic.road.vehicles == [front]
    hit = [agent in (rear.driver_id, middle.driver_id) for agent in tracks.agent_id]
    assert tracks.flagged(TrackFlag.COLLIDED).tolist() == hit
    assert tracks.flagged(TrackFlag.REMOVED).tolist() == hit
    assert (tracks.valid.sum(axis=1) < 15).tolist() == hit
    assert len(traffic.road.collided_pairs) == 1


def test_a_car_off_the_road_is_removed_and_said_to_be():
    options = options_of(short("highway", vehicles=2))
    drawn = {"lanes": 1.0, "speed_limit_mps": 20.0, "density_per_km_lane": 10.0}
    traffic = highway_traffic(options, drawn, Crew(POPULATION, seed=1, episode=0), time_s=10.0)
    traffic.road.vehicles[0].position[1] = 9.0
    traffic.advance()
    assert traffic.removals() == {"off_road": 1}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"options": {"layout": "highway", "vehicle": 3}}, "did you mean 'vehicles'"),
        ({"options": {"layout": "spaghetti"}}, "layout"),
        ({"options": {"layout": "merge"}}, "unknown parameter 'density_per_km_lane'|'ramp_share' is missing"),
        ({"options": {"layout": "highway", "simulation_hz": 15}}, "simulation_hz"),
        ({"parameters": {}}, "'density_per_km_lane' is missing"),
        ({"backend": "sumo"}, "not 'highway'"),
    ],
)
def test_what_does_not_fit_is_named(change, says):
    scenario = load_scenario("highway").model_copy(update=change)
    with pytest.raises(InputError, match=says):
        HighwayBackend().run_episode(scenario, POPULATION, seed=1, episode=0)
