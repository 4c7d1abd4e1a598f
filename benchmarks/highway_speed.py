"""What the searches for all cars at once are worth: highway-env's own road against ours, same cars, same steps.

    python -m benchmarks.highway_speed [--vehicles 20 50 100] [--seconds 10] [--repeats 3]

Three ways through the same straight motorway of four lanes at 10 Hz: highway-env as it comes (its Road and IDMVehicle),
its cars on our road (only the searches differ), and styled drivers on our road (what `generate` runs). Printed are
vehicle-steps per second, median of the repeats with the range, and the ratio to the first. The searches are compared
with highway-env's answers in tests/reference/test_highway_env_searches.py.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle

from stylesim.population import Population
from stylesim.simulation.highway.road import StyledRoad
from stylesim.simulation.highway.traffic import Crew
from stylesim.simulation.highway.vehicle import StyledVehicle

LIMIT_MPS, LANES, HZ = 30.0, 4, 10
SPACING_M = 100.0  # 10 cars per km and lane


def filled(road: Road, kind: type[IDMVehicle], vehicles: int) -> Road:
    rng = np.random.default_rng(0)
    for number in range(vehicles):
        place = 50.0 + SPACING_M * (number // LANES) + rng.uniform(0.0, 30.0)
        car = kind.make_on_lane(road, ("0", "1", number % LANES), place, float(rng.uniform(20.0, 28.0)))
        car.target_speed = float(rng.uniform(20.0, 35.0))
        road.vehicles.append(car)
    return road


def network(vehicles: int, seconds: float) -> RoadNetwork:
    length = SPACING_M * (vehicles // LANES + 2) + 60.0 * seconds
    return RoadNetwork.straight_road_network(LANES, length=length, speed_limit=LIMIT_MPS)


def theirs(vehicles: int, seconds: float) -> Road:
    return filled(Road(network=network(vehicles, seconds), np_random=np.random.default_rng(0)), IDMVehicle, vehicles)


def their_cars(vehicles: int, seconds: float) -> Road:
    road = StyledRoad(network=network(vehicles, seconds), np_random=np.random.default_rng(0))
    return filled(road, IDMVehicle, vehicles)


def styled(vehicles: int, seconds: float) -> Road:
    road = StyledRoad(network=network(vehicles, seconds), np_random=np.random.default_rng(0))
    filled(road, StyledVehicle, vehicles)
    crew = Crew(Population.load("tdbm_spectrum"), seed=0, episode=0)
    for car in road.vehicles:
        crew.hire(car)
    return road


WAYS: dict[str, Callable[[int, float], Road]] = {
    "highway-env": theirs,
    "its cars, our road": their_cars,
    "styled drivers": styled,
}


def rate(way: Callable[[int, float], Road], vehicles: int, seconds: float) -> float:
    road = way(vehicles, seconds)
    steps = round(seconds * HZ)
    started = time.perf_counter()
    for _ in range(steps):
        road.act()
        road.step(1.0 / HZ)
    return vehicles * steps / (time.perf_counter() - started)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, nargs="+", default=[20, 50, 100])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--repeats", type=int, default=3)
    asked = parser.parse_args()
    print(f"{'vehicles':>9} {'way':<20} {'vehicle-steps/s':>16} {'range':>16} {'ratio':>6}   (n = {asked.repeats})")
    for vehicles in asked.vehicles:
        found: dict[str, list[float]] = {name: [] for name in WAYS}
        for _ in range(asked.repeats):  # in turn, so that what else the machine does falls on all alike
            for name, way in WAYS.items():
                found[name].append(rate(way, vehicles, asked.seconds))
        first = statistics.median(found["highway-env"])
        for name, rates in found.items():
            middle = statistics.median(rates)
            span = f"{min(rates):,.0f}-{max(rates):,.0f}"
            print(f"{vehicles:>9} {name:<20} {middle:>16,.0f} {span:>16} {middle / first:>6.1f}")


if __name__ == "__main__":
    main()
