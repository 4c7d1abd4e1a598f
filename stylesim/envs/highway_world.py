"""`HighwayWorld`: the roads of highway-env with the styled crowd of `simulation.highway` and one ego or several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.envs.config import EnvConfig
from stylesim.envs.highway_ego import EGO_ID, EgoVehicle
from stylesim.envs.highway_lights import SeenLights
from stylesim.envs.world import LEAVES, NO_DECISION, EgoCommand, EgoState, Picture, Snapshot
from stylesim.errors import SimulationError
from stylesim.geometry import wrap_angle
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import Scenario
from stylesim.simulation.highway.lanes import road_of
from stylesim.simulation.highway.layouts import traffic_of
from stylesim.simulation.highway.planned import ahead_m
from stylesim.simulation.highway.spec import options_of
from stylesim.simulation.highway.traffic import Crew, Traffic
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.style import STYLE_CLASSES
from stylesim.tracks import TrackFlag

CODES = {name: code for code, name in enumerate(STYLE_CLASSES)}
SETTLE_S = 2.0  # chosen, because the crowd starts in loose columns and needs no more to take up its gaps
PATIENCE_S = 60.0  # chosen, because an intersection lets in about one car every two seconds


class HighwayWorld:
    """One episode at a time, in this process: highway-env keeps no global state."""

    def __init__(self, config: EnvConfig, *, egos: int = 1) -> None:
        self._config = config
        self._names = (EGO_ID, *(f"{EGO_ID}.{number}" for number in range(1, egos)))
        self._traffic: Traffic | None = None
        self._egos: list[EgoVehicle] = []
        self._last: dict[str, EgoState] = {}

    def reset(self, *, scenario: Scenario, population: Population, seed: int) -> tuple[Snapshot, ...]:
        """A new episode; InputError for a scenario that does not fit."""
        options = options_of(scenario)
        drawn = scenario.draw(stream(seed, 0, "", "parameters"))
        crew = Crew(population, seed=seed, episode=0)
        # a log lets nobody in at its end, who would be seen too short: here cars come to the end of the episode
        time_s = SETTLE_S + self._config.duration_s + self._config.period_s + PATIENCE_S
        self._egos, self._last = [], {}
        self._traffic = traffic_of(options, drawn, crew, time_s=time_s)
        self._lights = SeenLights(self._traffic.lights)
        self._dt_s = 1.0 / options.simulation_hz
        self._numbers: dict[str, int] = {name: number for number, name in enumerate(self._names)}
        for _ in range(round(SETTLE_S * options.simulation_hz)):
            self._traffic.advance()
            self._lights.after_step(())
        self._hand_over(stream(seed, 0, EGO_ID, "entry"))
        return self._snapshots()

    def _hand_over(self, rng: np.random.Generator) -> None:
        """Cars of the half with most road ahead become the egos', so that most of the traffic lies about and ahead."""
        road, count = self._road(), len(self._names)
        self._wait_for_traffic(count)
        farthest_first = sorted(
            (car for car in road.vehicles if not car.crashed), key=lambda car: (-ahead_m(car), car.driver_id)
        )
        half = max(count, len(farthest_first) // 2)
        chosen = rng.choice(half, size=count, replace=False) if count > 1 else [int(rng.integers(half))]
        for name, number in zip(self._names, chosen, strict=True):
            driver = farthest_first[number]
            ego = EgoVehicle(road, driver.position, driver.heading, driver.speed)
            ego.target_lane_index = driver.target_lane_index
            ego.route = driver.route
            ego.obey(self._config, name)
            road.vehicles[road.vehicles.index(driver)] = ego
            self._egos.append(ego)

    def _wait_for_traffic(self, count: int) -> None:
        """Let the crowd come in until there are enough drivers to take over."""
        assert self._traffic is not None
        for _ in range(round(PATIENCE_S / self._dt_s)):
            if sum(not car.crashed for car in self._traffic.road.vehicles) >= count:
                return
            self._traffic.advance()
        here = len(self._road().vehicles)
        raise SimulationError(f"only {here} drivers are on the road; {count} are to be taken over")

    def step(self, commands: Sequence[EgoCommand]) -> tuple[Snapshot, ...]:
        """One decision period, cut short where the last ego crashes or arrives."""
        road = self._road()
        for ego, command in zip(self._egos, commands, strict=True):
            if command.lane_change == LEAVES:
                road.vehicles = [car for car in road.vehicles if car is not ego]
            else:
                ego.begin_period(command)
        assert self._traffic is not None
        for _ in range(max(1, round(self._config.period_s / self._dt_s))):
            self._traffic.advance()
            self._lights.after_step(self._egos)
            driving = [ego for ego in self._egos if self._drives(ego)]
            if not driving:
                break
            road.vehicles = [car for car in road.vehicles if car not in self._egos or not car.crashed]
        return self._snapshots()

    def _drives(self, ego: EgoVehicle) -> bool:
        return not ego.crashed and ego in self._road().vehicles

    def picture(self) -> Picture:
        """The road of this episode, and a stop line for each lane that has a light."""
        assert self._traffic is not None
        network, against = self._road().network, self._road().graph.against
        road = road_of(network, junction_nodes=self._traffic.junction_nodes, against=against)
        return Picture(road, self._lights.stop_lines_m(road))

    def close(self) -> None:
        """Forget the episode."""
        self._traffic, self._egos = None, []

    def _road(self) -> Any:
        if self._traffic is None:
            raise SimulationError("no episode is running; call reset()")
        return self._traffic.road

    def _snapshots(self) -> tuple[Snapshot, ...]:
        crowd = [car for car in self._road().vehicles if car not in self._egos]
        for car in crowd:
            self._numbers.setdefault(car.driver_id, len(self._numbers))
        return tuple(self._snapshot(ego, crowd) for ego in self._egos)

    def _snapshot(self, ego: EgoVehicle, crowd: list[StyledVehicle]) -> Snapshot:
        """What one ego sees: itself, the other egos that drive, and the crowd."""
        beside = [other for other in self._egos if other is not ego and self._drives(other)]
        cars: list[StyledVehicle] = [ego, *beside, *crowd]
        styles = [car.style for car in cars]
        mine = self._numbers[ego.driver_id]
        numbers = [self._numbers[car.driver_id] for car in cars]
        return Snapshot(
            ego=self._state(ego),
            number=np.array([0, *(n or mine for n in numbers[1:])], np.int32),
            pose=np.array([_pose(car) for car in cars]),
            style=np.array([CODES[style.name] if style else -1 for style in styles], np.int8),
            knob=np.array([style.aggressiveness if style else 0.0 for style in styles], np.float32),
            decision=np.array([NO_DECISION, *(self._lights.decision(car) for car in cars[1:])], np.int8),
            ran_red=np.array([False, *(self._lights.flagged(car, TrackFlag.RAN_RED) for car in cars[1:])]),
            crashed=np.array([bool(car.crashed) for car in cars]),
            lights=self._lights.states(),
        )

    def _state(self, ego: EgoVehicle) -> EgoState:
        assert self._traffic is not None
        here = ego in self._road().vehicles or ego.crashed
        if not here and ego.driver_id in self._last:  # at its goal, or off the road, which counts as a collision
            lost = self._traffic.removed.get(ego.driver_id) == "off_road"
            state = self._last[ego.driver_id]._replace(travelled_m=ego.travelled_m, time_s=ego.steps * self._dt_s)
            return state._replace(arrived=float(not lost), collided=float(lost))
        along, right = ego.lane.local_coordinates(ego.position)
        start, end, lane = ego.lane_index
        state = EgoState(
            time_s=ego.steps * self._dt_s,
            speed_mps=float(ego.speed),
            acceleration_mps2=float(ego.acceleration_mps2),
            rms_acceleration_mps2=float(np.sqrt(np.mean(ego.squares))) if ego.squares else 0.0,
            travelled_m=float(ego.travelled_m),
            lane_offset_m=-float(right),
            lane_heading_rad=float(wrap_angle(np.array(ego.lane.heading_at(along) - ego.heading))),
            lane_width_m=float(ego.lane.width_at(along)),
            speed_limit_mps=float(ego.lane.speed_limit),
            lanes_left=float(lane),
            lanes_right=float(len(self._road().network.graph[start][end]) - 1 - lane),
            collided=float(ego.crashed),
            **self._lights.ahead_of(ego, self._dt_s),
        )
        self._last[ego.driver_id] = state
        return state


def _pose(car: StyledVehicle) -> Float64[np.ndarray, " 7"]:
    """highway-env's y and angles turn the other way round; the velocity goes along the course, not the body."""
    course, (x, y) = car.heading + car.slip_rad, car.position
    vx, vy = car.speed * np.cos(course), -car.speed * np.sin(course)
    heading = float(wrap_angle(np.array(-car.heading)))
    return np.array([x, -y, vx, vy, heading, car.LENGTH, car.WIDTH], np.float64)
