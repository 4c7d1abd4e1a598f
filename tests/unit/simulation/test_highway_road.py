"""Lanes in our frame, neighbours, gaps along routes, and the right of way."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("highway_env")
from highway_env.road.lane import StraightLane

from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.simulation.highway.graph import bend_radius_m
from stylesim.simulation.highway.junction import JUNCTION_NODES, Junction
from stylesim.simulation.highway.lanes import road_of
from stylesim.simulation.highway.path import BEFORE_BEND, IN_BEND_MPS2, curve_speed_mps
from stylesim.simulation.highway.quick import QuickStraightLane
from stylesim.simulation.highway.right_of_way import RightOfWay
from stylesim.simulation.highway.spec import options_of
from stylesim.simulation.highway.traffic import Crew
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.style import CLASS_KNOB
from stylesim.styles import style_table


@pytest.fixture
def junction():
    drawn = {"initial_vehicles": 1.0, "spawn_per_s": 0.0, "speed_limit_mps": 10.0}
    crew = Crew(Population.load("tdbm_spectrum"), seed=1, episode=0)
    result = Junction(options_of(load_scenario("intersection")), drawn, crew)
    result.road.vehicles = []
    return result


def put(junction, arm, to, at, *, speed=8.0, style="careful"):
    vehicle = StyledVehicle.make_on_lane(junction.road, (f"o{arm}", f"ir{arm}", 0), at, speed)
    vehicle.plan_route_to(f"o{to}")
    streams = np.random.default_rng(arm).spawn(2)
    vehicle.adopt(style_table().at(CLASS_KNOB[style]), driver_id=f"{arm}-{at}", pedal=streams[0], lane=streams[1])
    junction.road.vehicles.append(vehicle)
    return vehicle


def test_the_lanes_of_the_intersection(junction):
    road = road_of(junction.road.network, junction_nodes=JUNCTION_NODES)
    assert len(road.lanes) == 20
    assert sum(lane.in_junction for lane in road.lanes) == 12
    assert sum(lane.stop_line_m is not None for lane in road.lanes) == 4
    for lane in road.lanes:
        assert bool(lane.successors) is not lane.lane_id.startswith("il"), "only exits lead nowhere"
        for name in lane.successors:
            gap = np.linalg.norm(road.lane(name).centre_line_m[0] - lane.centre_line_m[-1])
            assert gap < 1e-3, (lane.lane_id, name)
        assert lane.width_m == 4.0 and lane.speed_limit_mps == 10.0
    curved = road.lane("ir0-il3-0").centre_line_m  # right turn, radius 9 m
    assert len(curved) > 10
    step = np.diff(curved, axis=0)
    turn = step[0][0] * step[-1][1] - step[0][1] * step[-1][0]
    assert turn < 0, "a right turn must turn clockwise in a right-handed frame"


def test_quick_lanes_answer_as_the_slow_ones():
    lane = StraightLane([3.0, 4.0], [40.0, -20.0])
    quick = QuickStraightLane(lane)
    for place in np.random.default_rng(0).uniform(-50, 50, (20, 2)):
        assert quick.local_coordinates(place) == pytest.approx(lane.local_coordinates(place), abs=1e-9)
        assert quick.distance_with_heading(place, 1.3) == pytest.approx(lane.distance_with_heading(place, 1.3))


def test_gaps_go_around_the_corner(junction):
    follower, leader = put(junction, 0, 3, 95.0), put(junction, 0, 3, 95.0)
    lane = junction.road.network.get_lane(("il3", "o3", 0))
    leader.position = lane.position(5.0, 0.0)
    leader.heading = lane.heading_at(5.0)
    leader.target_lane_index = ("il3", "o3", 0)
    inner = next(leg for leg in follower.route if leg[0] == "ir0")
    arc = junction.road.network.get_lane(inner).length
    found, gap = junction.road.ahead(follower, follower.lane_index)
    assert found is leader is junction.road.neighbour_vehicles(follower)[0]
    assert gap == pytest.approx(5.0 + arc + 5.0 - leader.LENGTH, abs=0.01)


def test_curves_are_taken_at_a_speed_that_their_radius_allows(junction):
    near, far, straight = put(junction, 0, 3, 95.0), put(junction, 0, 3, 20.0), put(junction, 0, 2, 95.0)
    right = bend_radius_m(junction.road.network.get_lane(("ir0", "il3", 0)))
    across, before = min(2.5, IN_BEND_MPS2), 2.5 * BEFORE_BEND
    assert curve_speed_mps(near, 2.5) == pytest.approx(np.sqrt(across * right + 2 * before * 5.0))
    assert curve_speed_mps(far, 2.5) == pytest.approx(np.sqrt(across * right + 2 * before * 80.0))
    assert curve_speed_mps(straight, 2.5) == np.inf


@pytest.mark.parametrize(("style", "waits"), [("timid", True), ("aggressive", False)])
def test_the_gap_that_is_taken_is_the_styles(junction, style, waits):
    minor = put(junction, 0, 2, 96.0, speed=0.0, style=style)
    put(junction, 1, 3, 52.0, speed=9.0)  # on the major road, about 5 s away
    RightOfWay(junction.road.network, junction_nodes=JUNCTION_NODES).assign(junction.road.vehicles)
    assert minor.waits_for_gap is waits
    assert (minor.wished_speed_mps == 0.0) is waits


def test_the_major_road_does_not_wait_and_nobody_waits_for_who_does_not_cross(junction):
    major, opposite = put(junction, 1, 3, 90.0, speed=5.0), put(junction, 3, 1, 60.0, speed=9.0)
    put(junction, 0, 2, 96.0, speed=0.0)
    RightOfWay(junction.road.network, junction_nodes=JUNCTION_NODES).assign(junction.road.vehicles)
    assert not major.waits_for_gap
    assert not opposite.waits_for_gap
