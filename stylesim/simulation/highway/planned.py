"""A planner's vehicle in highway-env: a driver's place taken over, highway-env's bicycle steered by the planner."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stylesim.planners.answers import EGO_ID
from stylesim.planners.bicycle import EgoState
from stylesim.planners.driving import EgoDriver
from stylesim.planners.outcome import with_ego_flags
from stylesim.planners.seen import Frame, Place
from stylesim.randomness import stream
from stylesim.scene import Scene
from stylesim.simulation.highway.lanes import road_of
from stylesim.simulation.highway.spec import LOG_HZ
from stylesim.simulation.highway.traffic import Traffic
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.tracks import AgentKind


class PlannedVehicle(StyledVehicle):
    """A car without a style: nobody's pedal and wheel but the planner's (`action`)."""

    def act(self, action: Any = None) -> None:
        """What the planner said holds until it says something else; its lane is the one that it is on."""
        self.target_lane_index = self.lane_index


class PlannedEgo:
    """The ego of one episode; call `before_frame` ahead of every logged frame, `after_frame` behind it."""

    def __init__(self, traffic: Traffic, entry_point: str, *, name: str, seed: int, episode: int) -> None:
        self._traffic = traffic
        road = road_of(traffic.road.network, junction_nodes=traffic.junction_nodes, against=traffic.road.graph.against)
        scene_id = f"{name}-{seed}-{episode:05d}"
        signals = traffic.signals()
        lights = ((), ()) if signals is None else (signals.signal_id, signals.lane_id)
        self._driver = EgoDriver(entry_point, Place(scene_id, "highway_env", name, road, *lights, 1.0 / LOG_HZ))
        self._entry_point = entry_point
        self._rng = stream(seed, episode, EGO_ID, "entry")
        self._car: PlannedVehicle | None = None
        self._hardest_mps2 = 0.0

    def before_frame(self) -> None:
        """Take over one of the half of the cars that have most road ahead, as soon as there is a car."""
        road = self._traffic.road
        sound = [car for car in road.vehicles if not car.crashed]
        if self._car is not None or not sound:
            return
        cars = sorted(sound, key=lambda car: (-ahead_m(car), car.driver_id))
        driver = cars[int(self._rng.integers(max(1, len(cars) // 2)))]
        car = PlannedVehicle(road, driver.position, driver.heading, driver.speed)
        car.target_lane_index, car.route, car.needs = driver.target_lane_index, driver.route, driver.needs
        car.driver_id = EGO_ID
        car.action = {"acceleration": 0.0, "steering": 0.0}
        road.vehicles[road.vehicles.index(driver)] = car
        self._car = car

    def after_frame(self) -> None:
        """Ask the planner what to do until the next frame."""
        car = self._car
        if car is None or car.crashed or car not in self._traffic.road.vehicles:
            return
        state = EgoState(
            float(car.position[0]), -float(car.position[1]), -car.heading, car.speed, -car.action["steering"]
        )
        control = self._driver.drive(self._frame(car), state)
        self._hardest_mps2 = min(self._hardest_mps2, control.acceleration_mps2)
        car.action = {"acceleration": control.acceleration_mps2, "steering": -control.steering_rad}

    def in_scene(self, scene: Scene) -> Scene:
        """The scene of the episode with what happened to the ego."""
        partners = {
            other
            for pair in self._traffic.road.collided_pairs
            if EGO_ID in pair
            for other in pair
            if other not in ("", EGO_ID)
        }
        gone = self._car is not None and self._car not in self._traffic.road.vehicles
        counts = {
            **self._driver.counts,
            "ego_collisions": len(partners | self._driver.hit),
            "ego_left_the_network": int(gone and not (self._car is not None and self._car.crashed)),
            "episodes_without_an_ego": int(self._car is None),
        }
        return with_ego_flags(
            scene,
            entry_point=self._entry_point,
            hit=partners | self._driver.hit,
            hardest_mps2=self._hardest_mps2,
            counts=counts,
        )

    def _frame(self, ego: PlannedVehicle) -> Frame:
        """Everybody on the road now, in our frame (highway-env's y and angles turn the other way round)."""
        signals = self._traffic.signals()
        cars: list[StyledVehicle] = [ego, *(car for car in self._traffic.road.vehicles if car is not ego)]
        pose = np.empty((len(cars), 5))
        for row, car in enumerate(cars):
            course = car.heading + car.slip_rad
            vx, vy = car.speed * math.cos(course), -car.speed * math.sin(course)
            pose[row] = (car.position[0], -car.position[1], vx, vy, math.remainder(-car.heading, 2 * math.pi))
        return Frame(
            tuple(car.driver_id for car in cars),
            np.full(len(cars), AgentKind.CAR, np.int8),
            np.array([[car.LENGTH, car.WIDTH] for car in cars], np.float64),
            pose,
            np.zeros(0, np.int8) if signals is None else signals.state[:, -1],
        )


def ahead_m(car: StyledVehicle) -> float:
    """Road left to the car: the rest of its lane, and what follows on its route."""
    rest = float(car.lane.length - car.lane.local_coordinates(car.position)[0])
    legs = [leg for leg in car.route or () if leg[:2] != car.lane_index[:2]]
    return rest + sum(float(car.road.network.get_lane((*leg[:2], leg[2] or 0)).length) for leg in legs)
