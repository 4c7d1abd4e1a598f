"""The styled crowd of one SUMO episode, stepped from outside: the one place here that knows `simulation.sumo`."""

from __future__ import annotations

import tempfile
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.envs.world import DECIDED_GO, DECIDED_STOP, NO_DECISION, Picture
from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.scenario import Scenario
from stylesim.signals import SignalState
from stylesim.simulation.sumo.engine import Engine
from stylesim.simulation.sumo.episode import DT_S, prepare_episode, sumo_options
from stylesim.simulation.sumo.roads import RoadNetwork
from stylesim.simulation.sumo.signals import STATES
from stylesim.simulation.sumo.yellow import YellowController
from stylesim.style import DriverStyle


class SumoCrowd:
    """Loads an episode into the engine and steps it; knows every driver's style and what it did at the light.

    `extra_s` is how long after the scenario's own end drivers must still come in. Vehicles that the episode's files
    do not know (an ego) take part in the traffic, and are left out of `names` and `poses`.
    """

    def __init__(
        self, engine: Engine, scenario: Scenario, population: Population, *, seed: int, extra_s: float
    ) -> None:
        longer = scenario.model_copy(update={"duration_s": scenario.duration_s + extra_s})
        with tempfile.TemporaryDirectory(prefix="stylesim-env-") as folder:
            self.files = prepare_episode(longer, population, seed=seed, episode=0, folder=Path(folder))
            if self.files.options.signal is None:
                raise InputError(f"scenario {scenario.name!r} has no traffic light; this environment needs one")
            engine.load(sumo_options(self.files))  # reads the files whole
        self._engine = engine
        self.sumo: Any = engine.sumo
        self.signal = self.files.options.signal.junction
        self._yellow = YellowController(engine.sumo, self.files)
        self._events_seen = 0
        self._step = 0
        self._index: dict[str, int] = {}
        self.names: list[str] = []
        self.collided: set[str] = set()
        self.ran_red: set[str] = set()
        self.decision: dict[str, int] = {}
        self._main_link = [_main_link(self.files.network, lane) for lane in self.files.network.controlled_lanes()]
        self._on_lane: dict[str, set[str]] = {lane: set() for lane in self.files.network.controlled_lanes()}
        self._shown = ""
        self._onset_step: list[int] = []
        self._poses: Float64[np.ndarray, "vehicle 7"] | None = None

    @property
    def time_s(self) -> float:
        """SUMO's clock."""
        return self._step * DT_S

    def style(self, name: str) -> DriverStyle:
        """The commanded style of a driver."""
        return self.files.drivers[name].style

    def step(self) -> None:
        """0.1 s, with the drivers' decisions at yellow."""
        self._yellow.before_step(self._step)
        self._engine.step()
        self._step += 1
        self._watch_light()
        self._poses = None
        self.names = [name for name in self.sumo.vehicle.getIDList() if name in self.files.drivers]
        for event in self._yellow.events[self._events_seen :]:
            self.decision[event.driver_id] = DECIDED_STOP if event.stop else DECIDED_GO
        self._events_seen = len(self._yellow.events)
        for collision in self.sumo.simulation.getCollisions():
            self.collided |= {collision.collider, collision.victim}
        self._watch_stop_lines()

    def run_until(self, time_s: float) -> None:
        """Step until SUMO's clock shows `time_s`."""
        while self.time_s < time_s - DT_S / 2:
            self.step()

    def _watch_light(self) -> None:
        """Remember since when each link has been shown what it is shown."""
        shown = str(self.sumo.trafficlight.getRedYellowGreenState(self.signal))
        if shown == self._shown:
            return
        before = self._shown or " " * len(shown)
        since = self._onset_step or [self._step] * len(shown)
        self._onset_step = [
            self._step if a.lower() != b.lower() else s for a, b, s in zip(before, shown, since, strict=True)
        ]
        self._shown = shown

    def light(self, link: int) -> tuple[SignalState, float]:
        """What one link is shown, and for how many seconds it has been."""
        return STATES.get(self._shown[link], SignalState.UNKNOWN), (self._step - self._onset_step[link]) * DT_S

    def _watch_stop_lines(self) -> None:
        """Who has left a lane that ends at the light into the junction has crossed its stop line."""
        for lane, before in self._on_lane.items():
            now = set(self.sumo.lane.getLastStepVehicleIDs(lane))
            for name in before - now:
                if self._lane_shows_red(lane) and self._inside_junction(name):
                    self.ran_red.add(name)
            self._on_lane[lane] = now

    def _lane_shows_red(self, lane: str) -> bool:
        links = [link for link in self.files.network.links if link.lane == lane]
        return all(STATES.get(self._shown[link.index]) is SignalState.RED for link in links)

    def _inside_junction(self, name: str) -> bool:
        here = self.sumo.vehicle
        return name in here.getIDList() and here.getRoadID(name).startswith(":")

    def decided(self, name: str) -> int:
        """NO_DECISION, DECIDED_STOP or DECIDED_GO at the last yellow that concerned this driver."""
        return self.decision.get(name, NO_DECISION)

    def poses(self) -> Float64[np.ndarray, "vehicle 7"]:
        """Box centres, velocities, headings and sizes of `names`; computed once per step."""
        if self._poses is None:
            drivers = [self.files.drivers[name] for name in self.names]
            size = np.array([(driver.length_m, driver.width_m) for driver in drivers]).reshape(-1, 2)
            self._poses = poses_of(self.sumo, self.names, size)
        return self._poses

    def picture(self) -> Picture:
        """Road and stop lines, one for each controlled lane in the order of `lights`."""
        road = self.files.network.road
        lines = [road.lane(lane).stop_line_m for lane in self.files.network.controlled_lanes()]
        return Picture(road, np.array(lines, np.float64).reshape(-1, 2, 2))

    def lights(self) -> list[SignalState]:
        """What each controlled lane is shown: its straight movement's light if it has one."""
        return [STATES.get(self._shown[link], SignalState.UNKNOWN) for link in self._main_link]


def _main_link(network: RoadNetwork, lane: str) -> int:
    links = [link for link in network.links if link.lane == lane]
    return min(links, key=lambda link: (link.direction != "s", link.index)).index


def poses_of(sumo: Any, names: list[str], size_m: Float64[np.ndarray, "vehicle 2"]) -> Float64[np.ndarray, "vehicle 7"]:
    """x, y, vx, vy, heading, length, width: SUMO's front bumpers and compass angles turned into ours."""
    vehicle, n = sumo.vehicle, len(names)
    front = np.fromiter(chain.from_iterable(map(vehicle.getPosition, names)), np.float64, 2 * n).reshape(n, 2)
    heading = np.pi / 2 - np.radians(np.fromiter(map(vehicle.getAngle, names), np.float64, n))
    speed = np.fromiter(map(vehicle.getSpeed, names), np.float64, n)
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    centre = front - along * size_m[:, :1] / 2
    heading = np.remainder(heading + np.pi, 2 * np.pi) - np.pi
    return np.concatenate([centre, speed[:, None] * along, heading[:, None], size_m], axis=1)
