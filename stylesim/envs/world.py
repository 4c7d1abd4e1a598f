"""What an environment asks of the simulator behind it, and what it gets: the same for both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int8, Int32

from stylesim.envs.config import EnvConfig
from stylesim.population import Population
from stylesim.road import Road
from stylesim.scenario import Scenario

NO_DECISION, DECIDED_STOP, DECIDED_GO = 0, 1, 2
DECISIONS = ("", "stop", "go")
LEAVES = 127  # fits the byte that carries a lane change


class EgoCommand(NamedTuple):
    """What the ego shall do until the next decision. `target_speed_mps` is NaN where the acceleration is given."""

    acceleration_mps2: float
    target_speed_mps: float
    lane_change: int  # +1 to the left, -1 to the right, 0 none, LEAVES to be taken off the road

    def wished_acceleration(self, speed_mps: float, config: EnvConfig) -> float:
        """The acceleration at this speed, within the ego's limits."""
        if np.isnan(self.target_speed_mps):
            wish = self.acceleration_mps2
        else:
            wish = (self.target_speed_mps - speed_mps) / config.speed_control_time_s
        return float(min(max(wish, -config.max_deceleration_mps2), config.max_acceleration_mps2))


LEAVE = EgoCommand(0.0, float("nan"), LEAVES)  # for an ego whose episode is over while others go on


class EgoState(NamedTuple):
    """The ego on its road, after a decision period. Numbers only, so that it travels as one block of float64."""

    time_s: float = 0.0  # since the first observation
    speed_mps: float = 0.0
    acceleration_mps2: float = 0.0  # of the last simulation step
    rms_acceleration_mps2: float = 0.0  # over the period
    travelled_m: float = 0.0  # over the period
    lane_offset_m: float = 0.0  # left of the centre line is positive
    lane_heading_rad: float = 0.0  # heading relative to the lane
    lane_width_m: float = 3.5
    speed_limit_mps: float = 0.0
    lanes_left: float = 0.0
    lanes_right: float = 0.0
    signal_state: float = 0.0  # SignalState of the light ahead
    stop_line_m: float = np.inf  # from the front bumper; inf where no light is ahead
    since_onset_s: float = 0.0  # of that state
    collided: float = 0.0
    reds_run: float = 0.0  # over the period
    arrived: float = 0.0  # has left the network at the end of its route


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Everybody at one moment; row 0 is the ego. Positions are box centres, x east, y north."""

    ego: EgoState
    number: Int32[np.ndarray, " vehicle"]  # stable within the episode, the ego is 0
    pose: Float64[np.ndarray, "vehicle 7"]  # x, y, vx, vy, heading, length, width
    style: Int8[np.ndarray, " vehicle"]  # index into STYLE_CLASSES, -1 unknown
    knob: Float32[np.ndarray, " vehicle"]  # aggressiveness, 0 where unknown
    decision: Int8[np.ndarray, " vehicle"]  # at the last onset of yellow
    ran_red: Bool[np.ndarray, " vehicle"]
    crashed: Bool[np.ndarray, " vehicle"]
    lights: Int8[np.ndarray, " light"]  # SignalState of each stop line of `World.picture`


@dataclass(frozen=True, eq=False)
class Picture:
    """What a renderer draws beneath the vehicles: the road, and the stop lines in the order of `Snapshot.lights`."""

    road: Road
    stop_lines_m: Float64[np.ndarray, "light 2 2"]


@runtime_checkable
class World(Protocol):
    """A simulation with one ego or several in it; every ego sees everybody, itself in row 0."""

    def reset(self, *, scenario: Scenario, population: Population, seed: int) -> tuple[Snapshot, ...]:
        """A new episode; one snapshot for each ego. SimulationError if the simulator refuses."""

    def step(self, commands: Sequence[EgoCommand]) -> tuple[Snapshot, ...]:
        """One decision period, a command and a snapshot for each ego; it is cut short where no ego is left.

        An ego that has collided or arrived keeps its last state; where others go on it is taken off the road.
        """

    def picture(self) -> Picture:
        """The road of this episode."""

    def close(self) -> None:
        """End it; twice does no harm."""
