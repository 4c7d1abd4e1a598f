"""The traffic of one episode: who drives, where they start, who comes and who goes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

import numpy as np
from highway_env.road.road import RoadNetwork

from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.signals import Signals
from stylesim.simulation.highway.lights import Lights
from stylesim.simulation.highway.road import StyledRoad
from stylesim.simulation.highway.spec import HighwayOptions
from stylesim.simulation.highway.vehicle import TOP_SPEED_MPS, StyledVehicle
from stylesim.simulation.plan import Twin, salted
from stylesim.tracks import TrackFlag

RUN_UP_M = 100.0  # road behind the last car at the start


class Crew:
    """Gives every car a driver, drawn from the population by the car's number, and an id."""

    def __init__(self, population: Population, *, seed: int, episode: int, twin: Twin | None = None) -> None:
        self._population = population
        self._key = (seed, episode)
        self._hired = 0
        self._twin = twin
        self._differs = twin is not None and twin.at_s is None  # the twin's driver is another one by now

    def stream(self, purpose: str) -> np.random.Generator:
        """The episode's own random stream for that purpose."""
        return stream(*self._key, "", purpose)

    def driver_stream(self, driver_id: str, purpose: str) -> np.random.Generator:
        """The driver's random stream for that purpose, from now on (a null twin's is another one)."""
        twin = self._twin
        other = self._differs and twin is not None and twin.new_noise and twin.driver == driver_id
        return stream(*self._key, driver_id, salted(purpose, new_noise=other))

    def hire(self, vehicle: StyledVehicle, *, limit_mps: float | None = None) -> None:
        """Give the car its driver, unless it has one or is an ego; the limit of its way, where its lane has another."""
        if vehicle.style is not None or vehicle.driver_id:
            return
        driver_id = f"car-{self._hired:04d}"
        self._hired += 1
        limit = limit_mps or vehicle.lane.speed_limit
        style = self._population.draw(stream(*self._key, driver_id, "style"), backend="highway", limit_mps=limit)
        if self._twin is not None and self._differs and self._twin.driver == driver_id:
            style = self._twin.style
        pedal, lane = self.driver_stream(driver_id, "pedal"), self.driver_stream(driver_id, "lane wander")
        vehicle.adopt(style, driver_id=driver_id, pedal=pedal, lane=lane)

    def pass_over(self) -> None:
        """A car that did not come keeps its number, so that who comes later is who it would have been."""
        self._hired += 1

    def after_frame(self, time_s: float, vehicles: Iterable[StyledVehicle]) -> None:
        """At the moment of the twin its driver becomes another one; `time_s` is that of the frame just logged."""
        twin = self._twin
        if twin is None or twin.at_s is None or self._differs or time_s < twin.at_s - 1e-9:
            return
        self._differs = True
        for vehicle in vehicles:
            if vehicle.driver_id == twin.driver:
                purposes = ("pedal", "lane wander") if twin.new_noise else ()
                vehicle.become(twin.style, *(self.driver_stream(twin.driver, purpose) for purpose in purposes))


class Traffic:
    """A road full of styled cars; `removed` names those that were taken away, with the reason."""

    junction_nodes = ""  # how the names of the nodes inside a junction begin; "" where there is none
    lights: Lights | None = None

    def __init__(self, road: StyledRoad, crew: Crew, options: HighwayOptions) -> None:
        self.road = road
        self.removed: dict[str, str] = {}
        self._crew = crew
        self._crashed_stay_s = options.crashed_stay_s
        self._dt = 1.0 / options.simulation_hz
        self.counts: Counter[str] = Counter()  # what a layout counts beyond what every episode does

    def logged(self) -> list[StyledVehicle]:
        """The cars that the log shows now; newcomers are left out while they settle."""
        vehicles: list[StyledVehicle] = self.road.vehicles
        return vehicles

    def start_log(self) -> None:
        """From now on what happens counts."""
        for vehicle in self.road.vehicles:
            vehicle.emergency_braked = False

    def frame(self) -> list[StyledVehicle]:
        """The cars of the next logged frame."""
        return self.logged()

    def flags(self) -> Mapping[str, TrackFlag]:
        """What happened at lights, by driver."""
        return {}

    def signals(self) -> Signals | None:
        """What the lights showed in the logged frames; None without lights."""
        return None

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


def fastest_first(vehicles: Iterable[StyledVehicle]) -> list[StyledVehicle]:
    """By the speed that their drivers wish, because slower traffic keeps right."""
    return sorted(vehicles, key=lambda vehicle: (-vehicle.wished_speed_mps, vehicle.driver_id))


def highway_traffic(options: HighwayOptions, drawn: Mapping[str, float], crew: Crew, *, time_s: float) -> Traffic:
    """Cars in loose columns on a straight road that is long enough for the whole episode, faster ones farther left."""
    rng = crew.stream("placement")
    lanes, limit = round(drawn["lanes"]), drawn["speed_limit_mps"]
    spacing = 1000.0 / drawn["density_per_km_lane"]
    column = spacing * -(-options.vehicles // lanes)
    length = RUN_UP_M + 1.5 * column + min(TOP_SPEED_MPS, 1.5 * limit) * time_s + RUN_UP_M
    network = RoadNetwork.straight_road_network(lanes, length=float(np.ceil(length / 100) * 100), speed_limit=limit)
    road = StyledRoad(network=network, np_random=crew.stream("road"))
    place = [RUN_UP_M + spacing * rng.uniform(0.0, 0.5) for _ in range(lanes)]
    speed = limit * rng.uniform(0.8, 0.95, options.vehicles)
    for first in range(0, options.vehicles, lanes):
        beside = [
            StyledVehicle.make_on_lane(road, ("0", "1", 0), 0.0, speed[number])
            for number in range(first, min(first + lanes, options.vehicles))
        ]
        for vehicle in beside:
            crew.hire(vehicle)
        for lane, vehicle in enumerate(fastest_first(beside)):
            vehicle.stand_at(("0", "1", lane), place[lane])
            place[lane] += max(spacing * rng.uniform(0.5, 1.5), 2 * vehicle.LENGTH)
            road.vehicles.append(vehicle)
    return Traffic(road, crew, options)
