"""The two-way road: who overtakes, who does not, who falls back, and that nobody drives against those who come."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("highway_env")

from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import load_scenario
from stylesim.simulation.highway import HighwayBackend
from stylesim.simulation.highway.graph import LaneIndex
from stylesim.simulation.highway.lanes import road_of
from stylesim.simulation.highway.overtaking import overtaking
from stylesim.simulation.highway.road import StyledRoad
from stylesim.simulation.highway.two_way import two_way_site
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.simulation.plan import EpisodePlan, Stressor

OWN, PASSING = ("e1", "e2", 1), ("e1", "e2", 0)
DT_S = 0.1


class Stage:
    """An aggressive driver (or another one) behind a slow one, and perhaps somebody who comes."""

    def __init__(self, style: str = "aggressive", *, coming_m: float = math.inf) -> None:
        site = two_way_site({"speed_limit_mps": 25.0, "demand_vph": 600.0})
        self.road = StyledRoad(network=site.network, np_random=np.random.default_rng(0))
        self.road.graph.against = site.against
        self.cars: dict[str, StyledVehicle] = {}
        self.add("fast", style, OWN, 300.0, 20.0)
        self.add("slow", "cautious", OWN, 325.0, 18.0).event_mps2 = 0.0
        if coming_m < math.inf:
            self.add("comes", "careful", ("w1", "w2", 1), 3000.0 - 300.0 - coming_m, 25.0)

    def add(self, name: str, style: str, index: LaneIndex, along_m: float, speed_mps: float) -> StyledVehicle:
        driver = Population.of(**{style: 1.0}).draw(stream(3, 0, name, "style"), backend="highway", limit_mps=25.0)
        car = StyledVehicle.make_on_lane(self.road, index, along_m, speed_mps)
        car.adopt(driver, driver_id=name, pedal=stream(3, 0, name, "pedal"), lane=stream(3, 0, name, "lane"))
        car.route = [(*index[:2], None)]
        self.road.vehicles.append(car)
        self.cars[name] = car
        return car

    def drive(self, seconds: float) -> list[bool]:
        """Whether the first driver was overtaking, step by step."""
        found = []
        for _ in range(round(seconds / DT_S)):
            self.road.act()
            self.road.step(DT_S)
            found.append(overtaking(self.cars["fast"]))
        return found

    def along_m(self, name: str) -> float:
        return float(self.road.network.get_lane(OWN).local_coordinates(self.cars[name].position)[0])


def test_who_is_held_up_passes_on_an_empty_road_and_comes_back():
    stage = Stage()
    passing = stage.drive(20.0)
    assert any(passing)
    assert not passing[-1]
    assert stage.cars["fast"].lane_index == OWN
    assert stage.along_m("fast") > stage.along_m("slow") + 5.0
    assert stage.cars["fast"].passing_mps == 0.0
    assert not stage.road.collided_pairs


def test_who_is_patient_stays_behind():
    stage = Stage("cautious")
    assert not any(stage.drive(20.0))
    assert stage.along_m("fast") < stage.along_m("slow")


def test_nobody_pulls_out_before_somebody_who_comes_and_does_so_when_he_has_passed():
    stage = Stage(coming_m=250.0)
    passing = stage.drive(25.0)
    met = next(n for n in range(len(passing)) if passing[n]) * DT_S
    assert met > 250.0 / (25.0 + 25.0), "not before they have met"
    assert not stage.road.collided_pairs


def test_who_finds_that_somebody_comes_after_all_falls_back():
    stage = Stage()
    while stage.cars["fast"].lane_index != PASSING:
        stage.drive(DT_S)
    here = stage.along_m("fast")
    stage.add("comes", "careful", ("w1", "w2", 1), 3000.0 - here - 300.0, 25.0)
    passing = stage.drive(7.0)
    assert passing[0]
    assert not any(passing[40:50]), "it is back before they meet, after 300 m at 43 m/s or less"
    assert stage.along_m("fast") < stage.along_m("slow")
    assert not stage.road.collided_pairs


def test_the_lane_for_overtaking_is_the_other_directions():
    site = two_way_site({"speed_limit_mps": 25.0, "demand_vph": 600.0})
    road = road_of(site.network, against=site.against)
    assert len(road.lanes) == 6
    assert not any(lane.left_neighbour or lane.right_neighbour for lane in road.lanes)
    east, west = road.lane("e1-e2-1"), road.lane("w1-w2-1")
    assert east.centre_line_m[0, 1] == pytest.approx(-4.0)
    assert west.centre_line_m[0, 1] == pytest.approx(0.0)
    assert east.centre_line_m[0, 0] == pytest.approx(west.centre_line_m[-1, 0])


def test_bold_drivers_overtake_in_the_scenario_and_nobody_is_hit():
    scenario = load_scenario("hw_two_way").model_copy(update={"duration_s": 50.0})
    crowd = Population.of(aggressive=0.5, cautious=0.5)
    scene = HighwayBackend().run_episode(scenario, crowd, seed=3, episode=2)
    tracks = scene.tracks
    assert scene.counts["collisions"] == 0
    right = np.where(np.cos(tracks.heading_rad) > 0, tracks.position_m[..., 1] < -2.0, tracks.position_m[..., 1] > -2.0)
    against = tracks.valid & ~right
    styles = {tracks.driver[agent].name for agent in np.flatnonzero(against.sum(axis=1) > 10)}  # type: ignore[union-attr]
    assert styles == {"aggressive"}


def test_a_cut_in_is_refused():
    plan = EpisodePlan(stressors=(Stressor(kind="cut_in", share=1.0),))
    scenario, crowd = load_scenario("hw_two_way"), Population.load("neutral")
    with pytest.raises(InputError, match="one lane per direction"):
        HighwayBackend().run_episode(scenario, crowd, seed=1, episode=0, plan=plan)
