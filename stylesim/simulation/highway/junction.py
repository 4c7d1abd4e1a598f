"""highway-env's intersection with our cars: its road, its spawning, its right of way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from highway_env.envs.intersection_env import IntersectionEnv

from stylesim.simulation.highway.right_of_way import RightOfWay
from stylesim.simulation.highway.road import StyledRegulatedRoad, StyledRoad
from stylesim.simulation.highway.spec import HighwayOptions
from stylesim.simulation.highway.traffic import Crew, Traffic
from stylesim.simulation.highway.vehicle import StyledVehicle

SPAWN_EVERY_S = 1.0  # highway-env's intersection clears and spawns once per decision of 1 s
LOOK_EVERY_S = 0.5  # highway-env's regulation runs at 2 Hz
JUNCTION_NODES = "i"  # highway-env names the inner nodes of its intersection il0, ir0, ...


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
        # a stream of its own: highway-env draws from it for every car that comes, and who comes depends on the traffic
        self.road = StyledRegulatedRoad(network=self.road.network, np_random=self._crew.stream("road"))

    def _spawn_vehicle(self, *args: Any, **kwargs: Any) -> Any:
        vehicle = super()._spawn_vehicle(*args, **kwargs)
        if vehicle is not None:
            self._crew.hire(vehicle)
        else:
            self._crew.pass_over()
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
