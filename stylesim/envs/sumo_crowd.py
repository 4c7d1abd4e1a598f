"""The styled crowd of one SUMO episode, stepped from outside: the one place here that knows `simulation.sumo`."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.envs.sumo_light import LightWatch
from stylesim.envs.world import DECIDED_GO, DECIDED_STOP, Picture
from stylesim.population import Population
from stylesim.scenario import Scenario
from stylesim.signals import SignalState
from stylesim.simulation.sumo.engine import Engine
from stylesim.simulation.sumo.episode import DT_S, prepare_episode, sumo_options
from stylesim.simulation.sumo.flow import FlowSense
from stylesim.simulation.sumo.live import driven, poses_of, shifted
from stylesim.simulation.sumo.live_foot import Feet
from stylesim.simulation.sumo.live_wander import Wander
from stylesim.simulation.sumo.missing_turns import MissedTurns
from stylesim.simulation.sumo.stopzone import StopZone
from stylesim.simulation.sumo.yellow import YellowController
from stylesim.style import STYLE_CLASSES
from stylesim.tracks import AgentKind

LONGEST_WAIT_S = 120.0  # chosen: an ego that waits for its place has one by then; drawing more drivers slows a reset

# By default SUMO reports a collision where the gap falls below minGap, although nobody has touched anybody.
TOUCHING_ONLY = ("--collision.mingap-factor", "0")


class SumoCrowd:
    """Loads an episode into the engine and steps it; knows every driver's style and what it did at the light.

    `extra_s` is how long drivers must still come in after the scenario's own end, or after two minutes. Vehicles
    that the episode's files do not know (an ego) take part in the traffic, and are left out of `rows` and `poses`.
    Drivers are numbered by their time of entry; `style`, `knob`, `decision`, `ran_red` and `collided` hold one value
    for each of them.
    """

    def __init__(
        self, engine: Engine, scenario: Scenario, population: Population, *, seed: int, extra_s: float
    ) -> None:
        until_s = min(scenario.duration_s, LONGEST_WAIT_S) + extra_s
        longer = scenario.model_copy(update={"duration_s": until_s})
        with tempfile.TemporaryDirectory(prefix="stylesim-env-") as folder:
            self.files = prepare_episode(longer, population, seed=seed, episode=0, folder=Path(folder))
            engine.load([*sumo_options(self.files), *TOUCHING_ONLY])  # reads the files whole
        self._engine = engine
        self.sumo: Any = engine.sumo
        self._yellow = YellowController(engine.sumo, self.files)
        self._zone = StopZone(engine.sumo, self.files)
        self._missed = MissedTurns(engine.sumo, self.files)
        self._flow = FlowSense(engine.sumo, self.files)
        self._wander, self._feet = Wander(self.files), Feet(self.files)
        self._events_seen = 0
        self._step = 0
        self._light = LightWatch(engine.sumo, self.files.network)
        drivers = self.files.drivers.values()
        self._number = {driver.driver_id: number for number, driver in enumerate(drivers)}
        self._size = np.array([(driver.length_m, driver.width_m) for driver in drivers]).reshape(-1, 2)
        self.style = np.array([STYLE_CLASSES.index(driver.style.name) for driver in drivers], np.int8)
        self.knob = np.array([driver.style.aggressiveness for driver in drivers], np.float32)
        self.decision = np.zeros(len(drivers), np.int8)
        self.ran_red = np.zeros(len(drivers), bool)
        self.collided = np.zeros(len(drivers), bool)
        self.foreign_collided: set[str] = set()
        self._here: dict[str, int] = {}
        self.rows: Int64[np.ndarray, " vehicle"] = np.zeros(0, np.int64)
        self._poses: Float64[np.ndarray, "vehicle 7"] | None = None

    @property
    def time_s(self) -> float:
        """SUMO's clock."""
        return self._step * DT_S

    def run_until(self, time_s: float) -> None:
        """Step until SUMO's clock shows `time_s`."""
        while self.time_s < time_s - DT_S / 2:
            self.step()

    def step(self) -> None:
        """0.1 s, with the drivers' decisions at yellow."""
        self._flow.before_step(self._step)
        self._yellow.before_step(self._step)
        self._zone.before_step(self._step)
        self._missed.before_step(self._step)
        self._engine.step()
        self._step += 1
        self._poses = None
        self._follow_traffic()
        for event in self._yellow.events[self._events_seen :]:
            self.decision[self._number[event.driver_id]] = DECIDED_STOP if event.stop else DECIDED_GO
        self._events_seen = len(self._yellow.events)
        for name in self._light.after_step(self._step):
            if name in self._number:
                self.ran_red[self._number[name]] = True
        for collision in self.sumo.simulation.getCollisions():
            self._note_collision(collision.collider)
            self._note_collision(collision.victim)

    def _note_collision(self, name: str) -> None:
        number = self._number.get(name)
        if number is None:
            self.foreign_collided.add(name)
        else:
            self.collided[number] = True

    def _follow_traffic(self) -> None:
        """Who is there: the list is only asked for when somebody has come or gone."""
        simulation = self.sumo.simulation
        if simulation.getDepartedNumber() or simulation.getArrivedNumber() or not self._here:
            self._here = {n: self._number[n] for n in self.sumo.vehicle.getIDList() if n in self._number}
            self.rows = np.fromiter(self._here.values(), np.int64, len(self._here))

    def poses(self) -> Float64[np.ndarray, "vehicle 7"]:
        """Box centres, velocities, headings and sizes of `rows`, with their pedal and wander; computed once per step.

        Wander starts with the first call; its first value is stationary, so what came before does not matter.
        """
        if self._poses is None:
            poses = poses_of(self.sumo, list(self._here), self._size[self.rows])
            ahead, speed = self._feet.advance(self.rows, np.hypot(poses[:, 2], poses[:, 3]))
            self._poses = shifted(driven(poses, ahead, speed), *self._wander.advance(self.rows, speed))
        return self._poses

    def look_again(self) -> None:
        """Somebody was taken off the road from outside: the next step asks who is there."""
        self._here = {}

    def drivers_here(self) -> list[str]:
        """Ids of the cars (no trucks) on the road that the crowd drives, in order of entry."""
        cars = self.files.drivers
        return [name for name in self._here if cars[name].kind == AgentKind.CAR]

    def light(self, link: tuple[str, int]) -> tuple[SignalState, float]:
        """What one link (light, index) is shown, and for how many seconds it has been."""
        return self._light.shown_since(link)

    def lights(self) -> list[SignalState]:
        """What each controlled lane is shown, in the order of the picture's stop lines."""
        return self._light.by_lane()

    def picture(self) -> Picture:
        """Road and stop lines, one for each controlled lane."""
        road = self.files.network.road
        lines = [road.lane(lane).stop_line_m for lane in self.files.network.controlled_lanes()]
        return Picture(road, np.array(lines, np.float64).reshape(-1, 2, 2))
