"""The roundabout: its lanes touch, the ring goes first, everybody gets through."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("highway_env")

from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.simulation.highway import HighwayBackend
from stylesim.simulation.highway.graph import LaneGraph
from stylesim.simulation.highway.lanes import road_of
from stylesim.simulation.highway.road import StyledRoad
from stylesim.simulation.highway.roundabout import ARMS, RING_M, RingRule, roundabout_site
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.style import CLASS_KNOB
from stylesim.styles import style_table

DRAWN = {"speed_limit_mps": 13.0, "demand_vph": 900.0}


def test_every_lane_goes_on_without_a_kink():
    site = roundabout_site(DRAWN)
    graph, lanes = LaneGraph(site.network), site.network.lanes_dict()
    for index, lane in lanes.items():
        assert bool(graph.after[index]) is not index[1].startswith("d")
        for other in graph.after[index]:
            turn = lane.heading_at(lane.length) - lanes[other].heading_at(0.0)
            assert abs((turn + math.pi) % (2 * math.pi) - math.pi) < 1e-6, (index, other)
    ring = [lane for index, lane in lanes.items() if index[0][-1] in "ex" and index[1][-1] in "ex"]
    assert sum(lane.length for lane in ring) == pytest.approx(2 * math.pi * RING_M)


def test_trips_lead_from_each_arm_to_the_three_others():
    site = roundabout_site(DRAWN)
    ways = {(trip.edges[0][0], trip.edges[-1][1]) for trip in site.trips}
    assert ways == {(f"o{a}", f"d{b}") for a in ARMS for b in ARMS if a != b}
    for trip in site.trips:
        for one, following in zip(trip.edges, trip.edges[1:], strict=False):
            assert one[1] == following[0]


def test_traffic_turns_counter_clockwise_in_our_frame():
    road = road_of(roundabout_site(DRAWN).network, junction_nodes="i")
    line = road.lane("ise-iex-0").centre_line_m.astype(np.float64)
    angle = np.unwrap(np.arctan2(line[:, 1], line[:, 0]))
    assert (np.diff(angle) > 0).all()
    assert sum(lane.stop_line_m is not None for lane in road.lanes) == 4


def cars(style: str, *, leaves_before: bool) -> tuple[RingRule, StyledVehicle, list[StyledVehicle]]:
    """One car at the southern entry, another on the ring west of it."""
    site = roundabout_site(DRAWN)
    on = StyledRoad(network=site.network, np_random=np.random.default_rng(0))
    enters = StyledVehicle.make_on_lane(on, ("os", "is0", 0), 144.0, 5.0)
    enters.route = [(*edge, None) for edge in site.trips[1].edges]
    circles = StyledVehicle.make_on_lane(on, ("iwe", "isx", 0), 1.0, 6.0)
    legs = (
        [("iwe", "isx"), ("isx", "is1"), ("is1", "ds")]
        if leaves_before
        else [("iwe", "isx"), ("isx", "ise"), ("ise", "iex")]
    )
    circles.route = [(*leg, None) for leg in legs]
    on.vehicles = [enters, circles]
    for number, car in enumerate(on.vehicles):
        streams = np.random.default_rng(number).spawn(2)
        car.adopt(style_table().at(CLASS_KNOB[style]), driver_id=str(number), pedal=streams[0], lane=streams[1])
    return RingRule(on.graph), enters, on.vehicles


@pytest.mark.parametrize(
    ("style", "leaves_before", "waits"), [("timid", False, True), ("aggressive", False, False), ("timid", True, False)]
)
def test_who_enters_waits_for_who_comes_round_as_long_as_its_style_wants(style, leaves_before, waits):
    rule, enters, everybody = cars(style, leaves_before=leaves_before)
    rule.assign(everybody)
    assert enters.waits_for_gap is waits


def test_who_has_waited_goes_on_waiting_until_it_stands():
    rule, enters, everybody = cars("timid", leaves_before=False)
    rule.assign(everybody)
    enters.stand_at(("os", "is0", 0), enters.lane.length - enters.LENGTH / 2 - 0.1)
    enters.speed = 1.5
    rule.assign(everybody)
    assert enters.waits_for_gap


def test_an_episode_runs_without_collision_and_people_reach_the_other_arms():
    scenario = load_scenario("hw_roundabout").model_copy(update={"warm_up_s": 2.0, "duration_s": 40.0})
    scene = HighwayBackend().run_episode(scenario, Population.load("tdbm_spectrum"), seed=2, episode=0)
    assert scene.counts["collisions"] == 0
    from_middle = np.linalg.norm(scene.tracks.position_m, axis=-1)
    assert (np.nanmin(from_middle, axis=1) < RING_M + 2).sum() >= 4
    assert np.nanmin(from_middle) > RING_M - 2.5
    along, across = scene.tracks.heading_rad[:, 1:], np.diff(scene.tracks.velocity_mps, axis=1) / scene.tracks.dt_s
    lateral = np.abs(across[..., 1] * np.cos(along) - across[..., 0] * np.sin(along))
    assert np.nanmax(lateral) < 5.0, "who enters has slowed down for the bend"
