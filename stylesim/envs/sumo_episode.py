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


class SumoEpisode:
    """Crowd and ego of one episode."""

    def __init__(
        self, engine: Engine, scenario: Scenario, population: Population, *, seed: int, config: EnvConfig
    ) -> None:
        self._config = config
        self._crowd = SumoCrowd(engine, scenario, population, seed=seed, extra_s=config.duration_s)
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
        arrived = EGO in sumo.simulation.getArrivedIDList()
        self._ego.after_step(arrived=arrived)
        if not arrived:
            self._pose = poses_of(sumo, [EGO], np.array([[LENGTH_M, WIDTH_M]]))[0]
            self._collided = EGO in self._crowd.foreign_collided or self._overlaps()

    def _overlaps(self) -> bool:
        """Does the ego's box overlap another's (SUMO looks along lanes only)."""
        others = self._crowd.poses()
        apart = np.hypot(others[:, 0] - self._pose[0], others[:, 1] - self._pose[1])
        near = others[apart < (others[:, 5] + others[:, 6] + LENGTH_M + WIDTH_M) / 2]  # a bound of the half diagonals
        if not len(near):
            return False
        mine = box_corners(self._pose[None, :2], self._pose[None, 4], self._pose[None, 5:7])
        return bool(boxes_overlap(mine, box_corners(near[:, :2], near[:, 4], near[:, 5:7])).any())

    def _snapshot(self) -> Snapshot:
        crowd, rows = self._crowd, self._crowd.rows
        return Snapshot(
            ego=self._ego.state(collided=self._collided),
            number=np.concatenate([[0], rows + 1]).astype(np.int32),
            pose=np.concatenate([self._pose[None], crowd.poses()]),
            style=_led_by(-1, crowd.style[rows]),
            knob=_led_by(0.0, crowd.knob[rows]),
            decision=_led_by(NO_DECISION, crowd.decision[rows]),
            ran_red=_led_by(False, crowd.ran_red[rows]),
            crashed=_led_by(self._collided, crowd.collided[rows]),
            lights=np.array(crowd.lights(), np.int8),
        )


def _led_by(first: float | int, rest: np.ndarray) -> np.ndarray:
    """An array of the ego's value and the others'."""
    return np.concatenate([np.array([first], rest.dtype), rest])
