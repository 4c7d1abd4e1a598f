"""The traffic of one episode: who drives, where they start, who comes and who goes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.road.road import RoadNetwork

from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.simulation.highway.right_of_way import RightOfWay
from stylesim.simulation.highway.road import StyledRegulatedRoad, StyledRoad
from stylesim.simulation.highway.spec import HighwayOptions
from stylesim.simulation.highway.vehicle import TOP_SPEED_MPS, StyledVehicle

RUN_UP_M = 100.0  # road behind the last car at the start
SPAWN_EVERY_S = 1.0  # highway-env's intersection clears and spawns once per decision of 1 s
LOOK_EVERY_S = 0.5  # highway-env's regulation runs at 2 Hz
JUNCTION_NODES = "i"  # highway-env names the inner nodes of its intersection il0, ir0, ...


class Crew:
    """Gives every car a driver, drawn from the population by the car's number, and an id."""

    def __init__(self, population: Population, *, seed: int, episode: int) -> None:
        self._population = population
        self._key = (seed, episode)
        self._hired = 0

    def stream(self, purpose: str) -> np.random.Generator:
        """The episode's own random stream for that purpose."""
        return stream(*self._key, "", purpose)

    def hire(self, vehicle: StyledVehicle) -> None:
        """Give the car its driver, unless it has one."""
        if vehicle.style is not None:
            return
        driver_id = f"car-{self._hired:04d}"
        self._hired += 1
        limit = vehicle.lane.speed_limit
        style = self._population.draw(stream(*self._key, driver_id, "style"), backend="highway", limit_mps=limit)
        pedal, lane = stream(*self._key, driver_id, "pedal"), stream(*self._key, driver_id, "lane wander")
        vehicle.adopt(style, driver_id=driver_id, pedal=pedal, lane=lane)


class Traffic:
    """A road full of styled cars; `removed` names those that were taken away, with the reason."""

    junction_nodes = ""  # how the names of the nodes inside a junction begin; "" where there is none

    def __init__(self, road: StyledRoad, crew: Crew, options: HighwayOptions) -> None:
        self.road = road
        self.removed: dict[str, str] = {}
        self._crew = crew
        self._crashed_stay_s = options.crashed_stay_s
        self._dt = 1.0 / options.simulation_hz

    def advance(self) -> None:
        """One simulation step; newcomers get their drivers, wrecks and cars off the road are taken away."""
        self.road.act()
        self.road.step(self._dt)
        for vehicle in self.road.vehicles:
            self._crew.hire(vehicle)
            if vehicle.crashed and vehicle.crashed_s > self._crashed_stay_s:
                self.removed[vehicle.driver_id] = "crashed"
            elif not vehicle.on_road:
                self.removed[vehicle.driver_id] = "off_road"
        if self.removed:
            self.road.vehicles = [v for v in self.road.vehicles if v.driver_id not in self.removed]

    def removals(self) -> Counter[str]:
        """How many cars were removed for which reason."""
        return Counter(self.removed.values())


def highway_traffic(options: HighwayOptions, drawn: Mapping[str, float], crew: Crew, *, time_s: float) -> Traffic:
    """Cars in loose columns on a straight road that is long enough for the whole episode."""
    rng = crew.stream("placement")
    lanes, limit = round(drawn["lanes"]), drawn["speed_limit_mps"]
    spacing = 1000.0 / drawn["density_per_km_lane"]
    column = spacing * -(-options.vehicles // lanes)
    length = RUN_UP_M + 1.5 * column + min(TOP_SPEED_MPS, 1.5 * limit) * time_s + RUN_UP_M
    network = RoadNetwork.straight_road_network(lanes, length=float(np.ceil(length / 100) * 100), speed_limit=limit)
    road = StyledRoad(network=network, np_random=crew.stream("road"))
    place = [RUN_UP_M + spacing * rng.uniform(0.0, 0.5) for _ in range(lanes)]
    for number in range(options.vehicles):
        lane = number % lanes
        vehicle = StyledVehicle.make_on_lane(road, ("0", "1", lane), place[lane], limit * rng.uniform(0.8, 0.95))
        place[lane] += max(spacing * rng.uniform(0.5, 1.5), 2 * vehicle.LENGTH)
        crew.hire(vehicle)
        road.vehicles.append(vehicle)
    return Traffic(road, crew, options)


class Junction(IntersectionEnv):  # type: ignore[misc]
    """highway-env's intersection: its road, its spawning, its right of way, with our cars and no ego.

    The car that highway-env would hand to an agent becomes one of the drivers.
    """

    road: StyledRoad
    controlled_vehicles: list[Any]

    def __init__(self, options: HighwayOptions, drawn: Mapping[str, float], crew: Crew) -> None:
        self._crew, self._limit_mps = crew, drawn["speed_limit_mps"]
        self.np_random = crew.stream("spawning")
        vehicle = f"{StyledVehicle.__module__}.{StyledVehicle.__qualname__}"
        super().__init__(
            {
                "initial_vehicle_count": round(drawn["initial_vehicles"]),
                "spawn_probability": min(drawn["spawn_per_s"] * SPAWN_EVERY_S, 1.0),
                "simulation_frequency": options.simulation_hz,
                "destination": None,  # the ego's too is drawn
                "other_vehicles_type": vehicle,
            }
        )
        self._release_ego()

    def _make_road(self) -> None:
        super()._make_road()
        for lane in self.road.network.lanes_list():
            lane.speed_limit = self._limit_mps
        self.road = StyledRegulatedRoad(network=self.road.network, np_random=self.np_random)

    def _spawn_vehicle(self, *args: Any, **kwargs: Any) -> Any:
        vehicle = super()._spawn_vehicle(*args, **kwargs)
        if vehicle is not None:
            self._crew.hire(vehicle)
        return vehicle

    def _release_ego(self) -> None:
        for ego in self.controlled_vehicles:
            driver = StyledVehicle.create_from(ego)
            driver.route = ego.route
            self._crew.hire(driver)
            self.road.vehicles[self.road.vehicles.index(ego)] = driver
        self.controlled_vehicles = []

    def come_and_go(self) -> None:
        """Take away who has reached an exit, and let a newcomer in by chance."""
        self._clear_vehicles()
        self._spawn_vehicle(spawn_probability=self.config["spawn_probability"])


class JunctionTraffic(Traffic):
    """Traffic that comes and goes by the intersection's own mechanics."""

    junction_nodes = JUNCTION_NODES

    def __init__(self, options: HighwayOptions, drawn: Mapping[str, float], crew: Crew) -> None:
        self._junction = Junction(options, drawn, crew)
        super().__init__(self._junction.road, crew, options)
        self._steps_per_turn = round(SPAWN_EVERY_S * options.simulation_hz)
        self._steps_per_look = round(LOOK_EVERY_S * options.simulation_hz)
        self._steps = 0
        self._right_of_way = RightOfWay(self.road.network, junction_nodes=JUNCTION_NODES)

    def advance(self) -> None:
        """One simulation step; twice a second drivers look for gaps, once a second cars come and go."""
        if self._steps % self._steps_per_look == 0:
            self._right_of_way.assign(self.road.vehicles)
        super().advance()
        self._steps += 1
        if self._steps % self._steps_per_turn == 0:
            self._junction.come_and_go()


def traffic_of(options: HighwayOptions, drawn: Mapping[str, float], crew: Crew, *, time_s: float) -> Traffic:
    """The traffic that the scenario's layout asks for, at its first moment; `time_s` is how long it must last."""
    if options.layout == "intersection":
        return JunctionTraffic(options, drawn, crew)
    return highway_traffic(options, drawn, crew, time_s=time_s)
