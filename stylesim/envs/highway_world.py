"""`HighwayWorld`: the motorway of highway-env with the styled crowd of `simulation.highway` and an ego."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.envs.config import EnvConfig
from stylesim.envs.highway_ego import EgoVehicle
from stylesim.envs.world import NO_DECISION, EgoCommand, EgoState, Picture, Snapshot
from stylesim.errors import InputError, SimulationError
from stylesim.geometry import wrap_angle
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import Scenario
from stylesim.simulation.highway.lanes import road_of
from stylesim.simulation.highway.spec import options_of
from stylesim.simulation.highway.traffic import Crew, Traffic, highway_traffic
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.style import STYLE_CLASSES

CODES = {name: code for code, name in enumerate(STYLE_CLASSES)}
SETTLE_S = 2.0  # chosen, because the crowd starts in loose columns and needs no more to take up its gaps


class HighwayWorld:
    """One episode at a time, in this process: highway-env keeps no global state."""

    def __init__(self, config: EnvConfig) -> None:
        self._config = config
        self._traffic: Traffic | None = None
        self._ego: EgoVehicle | None = None

    def reset(self, *, scenario: Scenario, population: Population, seed: int) -> Snapshot:
        """A new episode; InputError for a scenario of another layout than the motorway."""
        options = options_of(scenario)
        if options.layout != "highway":
            raise InputError(
                f"scenario {scenario.name!r} has layout {options.layout!r}; this environment needs 'highway'"
            )
        drawn = scenario.draw(stream(seed, 0, "", "parameters"))
        crew = _CrewWithEgo(population, seed=seed, episode=0)
        time_s = SETTLE_S + self._config.duration_s + self._config.period_s
        self._traffic = highway_traffic(options, drawn, crew, time_s=time_s)
        self._dt_s = 1.0 / options.simulation_hz
        self._numbers: dict[str, int] = {}
        self._steps, self._squares, self._travelled = 0, [0.0], 0.0
        self._ego = self._hand_over(stream(seed, 0, "ego", "entry"))
        for _ in range(round(SETTLE_S * options.simulation_hz)):
            self._advance()
        if self._ego.crashed:
            raise SimulationError(f"the ego was hit while the crowd of scenario {scenario.name!r} settled")
        self._steps, self._squares, self._travelled = 0, [0.0], 0.0
        return self._snapshot()

    def _hand_over(self, rng: np.random.Generator) -> EgoVehicle:
        """One of the cars in the rear half becomes the ego's, so that most of the traffic lies about and ahead."""
        road = self._road()
        behind_first = sorted(road.vehicles, key=lambda vehicle: vehicle.position[0])
        chosen = behind_first[int(rng.integers(max(1, len(behind_first) // 2)))]
        ego = EgoVehicle(road, chosen.position, chosen.heading, chosen.speed)
        ego.obey(self._config)
        road.vehicles[road.vehicles.index(chosen)] = ego
        return ego

    def step(self, command: EgoCommand) -> Snapshot:
        """One decision period, cut short by a crash of the ego."""
        ego = self._driven()
        ego.begin_period(command)
        self._squares, self._travelled = [], 0.0
        for _ in range(max(1, round(self._config.period_s / self._dt_s))):
            self._advance()
            if ego.crashed:
                break
        return self._snapshot()

    def _advance(self) -> None:
        ego = self._driven()
        assert self._traffic is not None
        self._traffic.advance()
        self._steps += 1
        self._squares.append(ego.acceleration_mps2**2)
        self._travelled += ego.speed * self._dt_s

    def picture(self) -> Picture:
        """The road of this episode; it has no stop lines."""
        return Picture(road_of(self._road().network), np.zeros((0, 2, 2)))

    def close(self) -> None:
        """Forget the episode."""
        self._traffic, self._ego = None, None

    def _road(self) -> Any:
        if self._traffic is None:
            raise SimulationError("no episode is running; call reset()")
        return self._traffic.road

    def _driven(self) -> EgoVehicle:
        if self._ego is None:
            raise SimulationError("no episode is running; call reset()")
        return self._ego

    def _snapshot(self) -> Snapshot:
        ego = self._driven()
        others: list[StyledVehicle] = [car for car in self._road().vehicles if car is not ego]
        cars = [ego, *others]
        styles = [car.style for car in others]
        numbers = self._numbers
        for car in others:
            numbers.setdefault(car.driver_id, len(numbers) + 1)
        return Snapshot(
            ego=self._state(ego),
            number=np.array(
                [0, *(self._numbers.setdefault(c.driver_id, len(self._numbers) + 1) for c in others)], np.int32
            ),
            pose=np.array([_pose(car) for car in cars]),
            style=np.array([-1, *(CODES[style.name] if style else -1 for style in styles)], np.int8),
            knob=np.array([0.0, *(style.aggressiveness if style else 0.0 for style in styles)], np.float32),
            decision=np.full(len(cars), NO_DECISION, np.int8),
            ran_red=np.zeros(len(cars), bool),
            crashed=np.array([bool(car.crashed) for car in cars]),
            lights=np.zeros(0, np.int8),
        )

    def _state(self, ego: EgoVehicle) -> EgoState:
        along, right = ego.lane.local_coordinates(ego.position)
        start, end, lane = ego.lane_index
        return EgoState(
            time_s=self._steps * self._dt_s,
            speed_mps=float(ego.speed),
            acceleration_mps2=float(ego.acceleration_mps2),
            rms_acceleration_mps2=float(np.sqrt(np.mean(self._squares))),
            travelled_m=float(self._travelled),
            lane_offset_m=-float(right),
            lane_heading_rad=float(wrap_angle(np.array(ego.lane.heading_at(along) - ego.heading))),
            lane_width_m=float(ego.lane.width_at(along)),
            speed_limit_mps=float(ego.lane.speed_limit),
            lanes_left=float(lane),
            lanes_right=float(len(self._road().network.graph[start][end]) - 1 - lane),
            collided=float(ego.crashed),
        )


class _CrewWithEgo(Crew):
    """A crew that gives every car a driver but the ego."""

    def hire(self, vehicle: StyledVehicle) -> None:
        if not isinstance(vehicle, EgoVehicle):
            super().hire(vehicle)


def _pose(car: StyledVehicle) -> Float64[np.ndarray, " 7"]:
    """highway-env's y and angles turn the other way round; the velocity goes along the course, not the body."""
    course, (x, y) = car.heading + car.slip_rad, car.position
    vx, vy = car.speed * np.cos(course), -car.speed * np.sin(course)
    heading = float(wrap_angle(np.array(-car.heading)))
    return np.array([x, -y, vx, vy, heading, car.LENGTH, car.WIDTH], np.float64)
