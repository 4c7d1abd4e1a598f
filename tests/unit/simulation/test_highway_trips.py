"""Sites with traffic through them: lane changes that a trip needs, who enters, who leaves, who misses its exit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("highway_env")

from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.simulation.highway import HighwayBackend
from stylesim.simulation.highway.graph import LaneGraph
from stylesim.simulation.highway.lane_choice import lane_needs
from stylesim.simulation.highway.lanes import road_of
from stylesim.simulation.highway.layouts import SITES
from stylesim.simulation.highway.open_traffic import OpenTraffic
from stylesim.simulation.highway.spec import options_of
from stylesim.simulation.highway.traffic import Crew

DRAWN = {
    "merge": {"lanes": 2.0, "speed_limit_mps": 30.0, "density_per_km_lane": 12.0, "ramp_share": 0.2},
    "exit": {"lanes": 3.0, "speed_limit_mps": 30.0, "density_per_km_lane": 12.0, "exit_share": 0.3},
}


def traffic(layout: str, *, seed: int = 1, time_s: float = 60.0, **changes: float) -> OpenTraffic:
    options = options_of(load_scenario(f"hw_{layout}"))
    crew = Crew(Population.load("tdbm_spectrum"), seed=seed, episode=0)
    return OpenTraffic(SITES[layout](DRAWN[layout] | changes), options, crew, time_s=time_s)


def test_what_a_trip_needs_is_counted_in_lanes_and_metres():
    site = SITES["exit"](DRAWN["exit"])
    graph = LaneGraph(site.network)
    through, leaving = (lane_needs(graph, trip.edges) for trip in site.trips)
    assert through["in", "begin", 0] == (0, 0.0)
    assert through["begin", "fork", 3] == (-1, 0.0), "the deceleration lane leads off the motorway"
    assert leaving["begin", "fork", 3] == (0, 0.0)
    assert leaving["in", "begin", 0] == (3, 250.0)
    assert leaving["in", "begin", 2] == (1, 250.0)


@pytest.mark.parametrize("layout", sorted(DRAWN))
def test_lanes_join_and_lead_somewhere(layout):
    site = SITES[layout](DRAWN[layout])
    road = road_of(site.network, junction_nodes=site.junction_nodes)
    ends = {f"{trip.edges[-1][0]}-{trip.edges[-1][1]}" for trip in site.trips}
    dead = {lane.lane_id for lane in road.lanes if not lane.successors and lane.lane_id.rsplit("-", 1)[0] not in ends}
    assert dead == ({"joint-end-2"} if layout == "merge" else set()), "only the acceleration lane ends"


def test_who_is_on_the_ramp_merges_before_its_lane_ends():
    crowd = traffic("merge", time_s=63.0, density_per_km_lane=5.0, ramp_share=0.5)
    entering = {}
    for step in range(450):
        crowd.advance()
        if step < 150:
            entering |= {car.driver_id: car for car in crowd.road.vehicles if car.lane_index[0] == "ramp"}
    assert len(entering) >= 3
    assert not crowd.road.collided_pairs
    assert all(car.target_lane_index[:2] == ("end", "out") for car in entering.values())


def test_who_leaves_takes_the_ramp_and_who_stays_does_not():
    crowd = traffic("exit", time_s=45.0, density_per_km_lane=4.0, lanes=2.0, exit_share=0.5)
    cars = {car.driver_id: car for car in crowd.road.vehicles}
    leaving = {name for name, car in cars.items() if car.route[-1][1] == "ramp"}
    assert len(leaving) >= 3
    steps = 900
    seen: dict[str, set[str]] = {name: set() for name in cars}
    for _ in range(steps):
        crowd.advance()
        for car in crowd.road.vehicles:
            seen.get(car.driver_id, set()).add(car.target_lane_index[1])
    took = {name for name, nodes in seen.items() if "slip" in nodes}
    assert took <= leaving
    assert len(leaving) - len(took) <= crowd.counts["missed_its_way"]


def test_everybody_is_seen_for_twenty_seconds_and_newcomers_settle_first():
    full = load_scenario("hw_merge")
    few = full.parameters["density_per_km_lane"].model_copy(update={"low": 5.0, "high": 5.0})
    scenario = full.model_copy(
        update={"parameters": {**full.parameters, "density_per_km_lane": few}, "duration_s": 64.0}
    )
    scene = HighwayBackend().run_episode(scenario, Population.load("tdbm_spectrum"), seed=11, episode=0)
    seconds = scene.tracks.valid.sum(axis=1) * scene.tracks.dt_s
    assert (seconds >= 20.0).mean() > 0.95
    late = np.flatnonzero(~scene.tracks.valid[:, 0])
    assert len(late) >= 5
    first = scene.tracks.valid[late].argmax(axis=1)
    entered = scene.tracks.position_m[late, first, 0]
    assert entered.min() > 40.0, "after 3 s nobody is at the entry any more"


def test_a_wider_wander_of_one_driver_does_not_change_who_comes_when():
    """Demand is drawn apart from the drivers."""
    one, other = traffic("merge"), traffic("merge")
    other._crew._population = replace(Population.load("tdbm_spectrum"), shares=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert one._due == other._due
