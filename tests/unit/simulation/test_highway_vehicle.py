"""A style must show in how the car drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("highway_env")
from highway_env.road.road import RoadNetwork

from stylesim.simulation.highway.following import cool
from stylesim.simulation.highway.noise import OrnsteinUhlenbeck
from stylesim.simulation.highway.road import StyledRoad
from stylesim.simulation.highway.steering import WHEEL_RAD, turned_wheel_rad
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.style import CLASS_KNOB
from stylesim.styles import style_table

DT = 0.1
LIMIT = 20.0


def road(lanes=1):
    network = RoadNetwork.straight_road_network(lanes, length=5000.0, speed_limit=LIMIT)
    return StyledRoad(network=network, np_random=np.random.default_rng(0))


def car(on, style, at, *, speed=LIMIT, lane=0, seed=0):
    vehicle = StyledVehicle.make_on_lane(on, ("0", "1", lane), at, speed)
    streams = np.random.default_rng(seed).spawn(2)
    vehicle.adopt(style_table().at(CLASS_KNOB[style]), driver_id=f"{style}-{at}", pedal=streams[0], lane=streams[1])
    on.vehicles.append(vehicle)
    return vehicle


def drive(on, seconds):
    for _ in range(round(seconds / DT)):
        on.act()
        on.step(DT)


def obstacle(on, at):
    vehicle = StyledVehicle.make_on_lane(on, ("0", "1", 0), at, 0.0)
    vehicle.act = lambda action=None: None
    on.vehicles.append(vehicle)
    return vehicle


def test_a_free_driver_reaches_its_own_wish_and_not_the_limit():
    speeds = {}
    for style in ("threatening", "cautious"):
        on = road()
        vehicle = car(on, style, 0.0)
        drive(on, 40)
        speeds[style] = vehicle.speed / LIMIT
    assert speeds["threatening"] == pytest.approx(1.3, abs=0.05)
    assert speeds["cautious"] == pytest.approx(0.85, abs=0.05)


def test_a_timid_driver_keeps_a_longer_headway_than_an_aggressive_one():
    headway = {}
    for style in ("aggressive", "timid"):
        on = road()
        leader, follower = car(on, "cautious", 100.0), car(on, style, 40.0)
        drive(on, 60)
        headway[style] = (leader.position[0] - follower.position[0] - leader.LENGTH) / follower.speed
    assert 0.6 < headway["aggressive"] < 1.6
    assert headway["timid"] > 2 * headway["aggressive"]


@pytest.mark.parametrize("style", sorted(CLASS_KNOB))
def test_nobody_reverses_or_hits_a_standing_car(style):
    on = road()
    vehicle = car(on, style, 0.0)
    obstacle(on, 150.0)
    least = vehicle.speed
    for _ in range(400):
        drive(on, DT)
        least = min(least, vehicle.speed)
    assert least >= 0.0
    assert vehicle.speed < 0.2
    assert not vehicle.crashed
    assert 137.0 < vehicle.position[0] < 145.0 - 0.5


def test_wander_has_the_styles_spread_and_stays_in_the_lane():
    spread = {}
    for style in ("reckless", "timid"):
        places = []
        for seed in range(4):
            on = road()
            vehicle = car(on, style, 0.0, seed=seed)
            for _ in range(600):
                drive(on, DT)
                places.append(vehicle.lane.local_coordinates(vehicle.position)[1])
        spread[style] = np.std(places)
        assert np.max(np.abs(places)) < 1.05
    assert spread["reckless"] == pytest.approx(0.37, abs=0.1), "0.55 m, softly bounded by the lane"
    assert spread["timid"] < 0.1


def test_an_eager_driver_overtakes_and_a_timid_one_stays_behind():
    lanes = {}
    for style in ("aggressive", "timid"):
        on = road(2)
        leader = car(on, "cautious", 60.0, speed=12.0)
        leader.road.network.get_lane(("0", "1", 0)).speed_limit = LIMIT
        follower = car(on, style, 20.0, speed=15.0)
        drive(on, 20)
        lanes[style] = follower.position[0] > leader.position[0]
    assert lanes == {"aggressive": True, "timid": False}


def test_a_lane_change_takes_about_as_long_as_the_driver_wants():
    on = road(2)
    vehicle = car(on, "careful", 0.0)
    vehicle.enable_lane_change = False
    drive(on, 2)
    vehicle.target_lane_index = ("0", "1", 1)
    seconds = 0.0
    while vehicle.position[1] < 3.6:
        drive(on, DT)
        seconds += DT
    assert 3.0 < seconds < 7.0


def test_the_noise_is_stationary_with_its_deviation_and_correlation_time():
    noise = OrnsteinUhlenbeck(0.5, 2.0, np.random.default_rng(1))
    values = np.array([noise.step(0.1) for _ in range(30_000)])
    assert values.std() == pytest.approx(0.5, rel=0.1)
    assert np.corrcoef(values[:-20], values[20:])[0, 1] == pytest.approx(np.exp(-1), abs=0.07)


def test_the_smoothed_noise_keeps_its_deviation_and_knows_its_rate():
    noise = OrnsteinUhlenbeck(0.5, 2.0, np.random.default_rng(1), smoothing_s=0.6)
    values = np.array([noise.step(0.1) for _ in range(30_000)])
    assert values.std() == pytest.approx(0.5, rel=0.1)
    before = noise.value
    after = noise.step(0.1)
    assert noise.rate == pytest.approx((after - before) / 0.1)


def test_a_cool_head_does_not_brake_hard_for_a_faster_car_that_cuts_in():
    assert cool(-12.0, 20.0, 22.0, 0.0, 10.0, bold=1.3, ease=2.0) > -2.5
    assert cool(-12.0, 20.0, 5.0, 0.0, 10.0, bold=1.3, ease=2.0) < -8.0


def test_two_cars_that_touch_are_one_collision():
    on = road()
    vehicle, _ = car(on, "aggressive", 0.0), obstacle(on, 14.0)
    drive(on, 2)
    assert vehicle.crashed
    assert len(on.collided_pairs) == 1


def test_who_looks_at_others_drives_by_what_they_drive():
    """With the whole wish taken from the traffic around, 10 % more than the neighbours drive, within the bounds."""
    on = road(2)
    for at in (0.0, 30.0, 60.0):
        neighbour = car(on, "careful", at, lane=1)
        neighbour.style = replace(neighbour.style, desired_speed_factor=0.95)
    vehicle = car(on, "careful", 20.0)
    vehicle.style = replace(vehicle.style, desired_speed_factor=0.85, flow_share=1.0, flow_speed_factor=1.1)
    assert vehicle.wished_speed_mps == pytest.approx(0.85 * LIMIT)
    drive(on, 20)
    around = np.mean([other.speed for other in on.vehicles if other is not vehicle])
    assert vehicle.wished_speed_mps == pytest.approx(min(1.1 * around, 1.25 * 0.85 * LIMIT), rel=0.03)
    assert all(other.flow_ratio == 1.0 for other in on.vehicles if other is not vehicle)


@pytest.mark.parametrize("pedal_mps2", [-3.0, 0.0, 3.0])
def test_who_turns_and_presses_a_pedal_stays_within_the_lateral_acceleration_that_is_accepted(pedal_mps2):
    vehicle = car(road(), "aggressive", 10.0, speed=8.0)
    vehicle.acceleration_mps2, wheel, dt = pedal_mps2, 0.0, 0.05
    across, before = [], None
    for _ in range(16):
        wheel = turned_wheel_rad(wheel, WHEEL_RAD, vehicle, dt)
        slip = np.arctan(np.tan(wheel) / 2)
        course = vehicle.heading + slip
        now = vehicle.speed * np.array([np.cos(course), np.sin(course)])
        if before is not None:
            change = (now - before) / dt
            across.append(change[1] * np.cos(vehicle.heading) - change[0] * np.sin(vehicle.heading))
        before = now
        vehicle.heading += vehicle.speed * np.sin(slip) / (vehicle.LENGTH / 2) * dt
        vehicle.speed += pedal_mps2 * dt
    assert 3.0 < max(across) < 4.0
