"""What we work out for all cars at once against highway-env's own answers, car by car, on its own networks."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("highway_env")
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.envs.merge_env import MergeEnv
from highway_env.envs.roundabout_env import RoundaboutEnv
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from stylesim.simulation.highway.path import reaches_into
from stylesim.simulation.highway.projection import Projection
from stylesim.simulation.highway.road import StyledRoad

NETWORKS = {"intersection": IntersectionEnv, "roundabout": RoundaboutEnv, "merge": MergeEnv}


def network(name: str) -> RoadNetwork:
    if name == "straight":
        return RoadNetwork.straight_road_network(3, length=400.0, speed_limit=30.0)
    return NETWORKS[name]().unwrapped.road.network


def cars(on: Road, kind: type[Vehicle], n: int = 40, seed: int = 3) -> list[Vehicle]:
    """Cars at random places about random lanes, on and beside them, some askew."""
    rng = np.random.default_rng(seed)
    lanes = list(on.network.lanes_dict().values())
    found = []
    for _ in range(n):
        lane = lanes[int(rng.integers(len(lanes)))]
        along = rng.uniform(-3.0, lane.length + 3.0)
        place = lane.position(along, rng.normal(0.0, 2.0))
        found.append(kind(on, place, float(lane.heading_at(along) + rng.normal(0.0, 0.3)), rng.uniform(0.0, 30.0)))
    return found


@pytest.mark.parametrize("name", ["straight", *NETWORKS])
def test_places_and_closest_lanes_are_highway_envs(name):
    on = Road(network=network(name), np_random=np.random.default_rng(0))
    on.vehicles = cars(on, Vehicle)
    projection = Projection(on.network)
    projection.update(on.vehicles)
    reaching = projection.reaching()
    for number, (index, lane) in enumerate(on.network.lanes_dict().items()):
        assert projection.index[number] == index
        for column, car in enumerate(on.vehicles):
            along, aside = lane.local_coordinates(car.position)
            assert projection.along_m[number][column] == pytest.approx(along, abs=1e-9)
            assert projection.aside_m[number][column] == pytest.approx(aside, abs=1e-9)
            assert reaching[number][column] == reaches_into(lane, along, aside, car)
    expected = [on.network.get_closest_lane_index(car.position, car.heading) for car in on.vehicles]
    assert [projection.index[number] for number in projection.closest()] == expected


@pytest.mark.parametrize("name", ["straight", "intersection"])
def test_who_touches_whom_is_highway_envs(name):
    dt = 0.1
    theirs = Road(network=network(name), np_random=np.random.default_rng(0))
    ours = StyledRoad(network=network(name), np_random=np.random.default_rng(0))
    crashed = []
    for on in (theirs, ours):
        on.vehicles = cars(on, Vehicle, n=60)
        on.step(dt)
        crashed.append([car.crashed for car in on.vehicles])
        on.step(dt)
        crashed[-1] += [car.crashed for car in on.vehicles]
    assert crashed[0] == crashed[1]
    assert any(crashed[0])
    for mine, other in zip(ours.vehicles, theirs.vehicles, strict=True):
        np.testing.assert_array_equal(mine.position, other.position)


def test_neighbours_on_a_straight_road_are_highway_envs():
    """Where everybody drives in the middle of a lane the two definitions of being on it agree."""
    theirs = Road(network=network("straight"), np_random=np.random.default_rng(0))
    ours = StyledRoad(network=network("straight"), np_random=np.random.default_rng(0))
    rng = np.random.default_rng(5)
    drawn = [
        (("0", "1", int(rng.integers(3))), float(rng.uniform(0, 400)), float(rng.uniform(20, 30))) for _ in range(40)
    ]
    for on in (theirs, ours):
        on.vehicles = [IDMVehicle.make_on_lane(on, index, along, speed) for index, along, speed in drawn]
    for mine, other in zip(ours.vehicles, theirs.vehicles, strict=True):
        for lane in range(3):
            found = ours.neighbour_vehicles(mine, ("0", "1", lane))
            wanted = theirs.neighbour_vehicles(other, ("0", "1", lane))
            places = [[None if v is None else v.position[0] for v in pair] for pair in (found, wanted)]
            assert places[0] == places[1]
