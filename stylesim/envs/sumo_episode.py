"""One episode of the SUMO environment, inside the child process: crowd, ego, and what is reported of them."""

from __future__ import annotations

import numpy as np

from stylesim.envs.config import EnvConfig
from stylesim.envs.sumo_crowd import SumoCrowd, poses_of
from stylesim.envs.sumo_ego import SumoEgo
from stylesim.envs.sumo_entry import EGO, LENGTH_M, WIDTH_M, insert_ego
from stylesim.envs.world import NO_DECISION, EgoCommand, Picture, Snapshot
from stylesim.errors import SimulationError
from stylesim.geometry import box_corners, boxes_overlap
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import Scenario
from stylesim.simulation.sumo.engine import Engine
from stylesim.style import STYLE_CLASSES

CODES = {name: code for code, name in enumerate(STYLE_CLASSES)}
NEAR_M = 25.0  # farther centres cannot touch: half the diagonals of the longest vehicles


class SumoEpisode:
    """Crowd and ego of one episode."""

    def __init__(
        self, engine: Engine, scenario: Scenario, population: Population, *, seed: int, config: EnvConfig
    ) -> None:
        self._config = config
        self._crowd = SumoCrowd(engine, scenario, population, seed=seed, extra_s=config.duration_s)
        self._numbers: dict[str, int] = {EGO: 0}
        self._collided = False
        self._pose = np.zeros(7)
        self._crowd.run_until(scenario.warm_up_s)
        rng = stream(seed, 0, EGO, "entry")
        _, place = insert_ego(self._crowd.sumo, self._crowd.run_until, rng=rng, config=config)
        self._ego = SumoEgo(self._crowd, config, place.speed_mps)
        coast = EgoCommand(0.0, float("nan"), 0)
        self._ego.begin_period(coast)
        self._advance(coast)  # SUMO takes the ego in with its next step
        self._ego.start_clock()
        if not self._ego.present or self._collided:
            raise SimulationError(f"the ego could not enter scenario {scenario.name!r}")
        self.first = self._snapshot()

    def step(self, command: EgoCommand) -> Snapshot:
        """One decision period, cut short by a collision or the arrival."""
        self._ego.begin_period(command)
        for _ in range(self._config.control_steps):
            if not self._ego.present or self._collided:
                break
            self._advance(command)
        return self._snapshot()

    def picture(self) -> Picture:
        """The road of this episode."""
        return self._crowd.picture()

    def _advance(self, command: EgoCommand) -> None:
        sumo = self._crowd.sumo
        self._ego.before_step(command)
        self._crowd.step()
        arrived = EGO not in sumo.vehicle.getIDList()
        self._ego.after_step(arrived=arrived)
        if not arrived:
            self._pose = poses_of(sumo, [EGO], np.array([[LENGTH_M, WIDTH_M]]))[0]
            self._collided = EGO in self._crowd.collided or self._overlaps()

    def _overlaps(self) -> bool:
        """Does the ego's box overlap another's (SUMO looks along lanes only)."""
        others = self._crowd.poses()
        near = others[np.hypot(*(others[:, :2] - self._pose[:2]).T) < NEAR_M]
        if not len(near):
            return False
        mine = box_corners(self._pose[None, :2], self._pose[None, 4], self._pose[None, 5:7])
        return bool(boxes_overlap(mine, box_corners(near[:, :2], near[:, 4], near[:, 5:7])).any())

    def _snapshot(self) -> Snapshot:
        crowd, names = self._crowd, self._crowd.names
        for name in names:
            self._numbers.setdefault(name, len(self._numbers))
        styles = [crowd.style(name) for name in names]
        return Snapshot(
            ego=self._ego.state(collided=self._collided),
            number=np.array([0, *(self._numbers[name] for name in names)], np.int32),
            pose=np.concatenate([self._pose[None], crowd.poses()]),
            style=np.array([-1, *(CODES[style.name] for style in styles)], np.int8),
            knob=np.array([0.0, *(style.aggressiveness for style in styles)], np.float32),
            decision=np.array([NO_DECISION, *map(crowd.decided, names)], np.int8),
            ran_red=np.array([False, *(name in crowd.ran_red for name in names)], bool),
            crashed=np.array([self._collided, *(name in crowd.collided for name in names)], bool),
            lights=np.array(crowd.lights(), np.int8),
        )
