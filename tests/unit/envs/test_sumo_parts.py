"""The parts of the SUMO environment that need no running simulation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stylesim.envs.sumo_entry import widest_gap
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import load_scenario
from stylesim.simulation.foot import footed
from stylesim.simulation.sumo.episode import prepare_episode
from stylesim.simulation.sumo.live import poses_of, shifted
from stylesim.simulation.sumo.live_draws import BLOCK
from stylesim.simulation.sumo.live_foot import Feet
from stylesim.simulation.sumo.live_wander import Wander
from stylesim.simulation.wander import ROOM_BEYOND_LANE_M, lateral_wander


def test_wander_step_by_step_is_the_wander_of_a_recorded_episode(tmp_path) -> None:
    files = prepare_episode(
        load_scenario("yellow_light"), Population.load("tdbm_spectrum"), seed=3, episode=0, folder=tmp_path
    )
    drivers = list(files.drivers.values())[:4]
    frames = BLOCK + 50  # over the end of the first block of draws
    speed = 8.0 + 8.0 * np.sin(np.arange(frames) / 60.0 + np.arange(4)[:, None])
    narrowest = min(lane.width_m for lane in files.network.road.lanes)
    expected = lateral_wander(
        [driver.style for driver in drivers],
        speed,
        limit_m=np.array([(narrowest - driver.width_m) / 2 + ROOM_BEYOND_LANE_M for driver in drivers]),
        dt_s=0.1,
        streams=[stream(3, 0, driver.driver_id, "wander") for driver in drivers],
    )
    wander, rows = Wander(files), np.arange(4)
    got = np.array([wander.advance(rows, speed[:, frame])[0] for frame in range(frames)]).T
    assert np.allclose(got, expected, atol=1e-12)
    assert np.ptp(got, axis=1).max() > 0.2


def test_sumos_front_bumper_and_compass_become_our_box_centre_and_heading() -> None:
    vehicle = SimpleNamespace(
        getPosition={"north": (10.0, 20.0), "east": (0.0, 0.0)}.__getitem__,
        getAngle={"north": 0.0, "east": 90.0}.__getitem__,
        getSpeed={"north": 5.0, "east": 2.0}.__getitem__,
    )
    poses = poses_of(SimpleNamespace(vehicle=vehicle), ["north", "east"], np.array([[4.0, 2.0], [6.0, 2.5]]))
    assert poses[0] == pytest.approx([10.0, 18.0, 0.0, 5.0, np.pi / 2, 4.0, 2.0])
    assert poses[1] == pytest.approx([-3.0, 0.0, 2.0, 0.0, 0.0, 6.0, 2.5])
    moved = shifted(poses, np.array([0.5, 0.0]), np.array([0.5, 0.0]))
    assert moved[0] == pytest.approx([9.5, 18.0, -0.5, 5.0, np.pi / 2 + np.arctan(0.1), 4.0, 2.0])
    assert moved[1] == pytest.approx(poses[1])


def lane_of(vehicles: list[tuple[float, float, float]]) -> SimpleNamespace:
    """A lane of 100 m at 15 m/s with vehicles (front, length, speed)."""
    known = {str(i): vehicle for i, vehicle in enumerate(vehicles)}
    return SimpleNamespace(
        lane=SimpleNamespace(
            getLastStepVehicleIDs=lambda lane: list(known), getLength=lambda lane: 100.0, getMaxSpeed=lambda lane: 15.0
        ),
        vehicle=SimpleNamespace(
            getLanePosition=lambda name: known[name][0],
            getLength=lambda name: known[name][1],
            getSpeed=lambda name: known[name][2],
        ),
    )


def test_the_widest_gap_is_taken_in_its_middle_at_a_pace_that_can_be_braked() -> None:
    place = widest_gap(lane_of([(95.0, 5.0, 0.0), (40.0, 5.0, 9.0)]), "lane")  # free from 40 to 90 m
    assert place.position_m == pytest.approx(90.0 - 22.5)
    assert place.speed_mps == pytest.approx(np.sqrt(2 * 2.0 * 22.5))
    assert place.slack_m > 0


def test_a_full_lane_has_no_room() -> None:
    full = lane_of([(99.0 - 6.0 * i, 5.0, 0.0) for i in range(17)])
    assert widest_gap(full, "lane").slack_m < 0


def test_feet_step_by_step_are_the_feet_of_a_recorded_episode(tmp_path) -> None:
    files = prepare_episode(
        load_scenario("yellow_light"), Population.load("tdbm_spectrum"), seed=3, episode=0, folder=tmp_path
    )
    drivers = list(files.drivers.values())[:4]
    frames = BLOCK + 50
    model = 8.0 + 8.0 * np.sin(np.arange(frames) / 60.0 + np.arange(4)[:, None])
    ahead, speed = footed(
        [driver.style for driver in drivers],
        model,
        dt_s=0.1,
        streams=[stream(3, 0, driver.driver_id, "pedal") for driver in drivers],
    )
    feet, rows = Feet(files), np.arange(4)
    got = np.array([feet.advance(rows, model[:, frame]) for frame in range(frames)])
    assert np.allclose(got[:, 0].T, ahead, atol=1e-12)
    assert np.allclose(got[:, 1].T, speed, atol=1e-12)
    assert np.abs(got[:, 0]).max() > 0.05
