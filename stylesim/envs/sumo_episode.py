"""One episode of the SUMO environment, inside the child process: crowd, egos, and what is reported of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stylesim.envs.config import EnvConfig
from stylesim.envs.sumo_crowd import SumoCrowd
from stylesim.envs.sumo_ego import SumoEgo
from stylesim.envs.sumo_entry import EGO, ego_names, insert_egos
from stylesim.envs.world import LEAVES, NO_DECISION, EgoCommand, Picture, Snapshot
from stylesim.errors import SimulationError
from stylesim.geometry import box_corners, boxes_overlap
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import Scenario
from stylesim.simulation.sumo.engine import Engine
from stylesim.simulation.sumo.live import poses_of
from stylesim.simulation.sumo.takeover import LENGTH_M, WIDTH_M

COAST = EgoCommand(0.0, float("nan"), 0)


class SumoEpisode:
    """Crowd and egos of one episode."""

    def __init__(
        self,
        engine: Engine,
        scenario: Scenario,
        population: Population,
        *,
        seed: int,
        config: EnvConfig,
        egos: int = 1,
    ) -> None:
        self._config = config
        self._crowd = crowd = SumoCrowd(engine, scenario, population, seed=seed, extra_s=config.duration_s)
        names = ego_names(egos)
        self._collided = dict.fromkeys(names, False)
        self._pose = {name: np.zeros(7) for name in names}
        crowd.run_until(scenario.warm_up_s)
        rng = stream(seed, 0, EGO, "entry")
        speeds = insert_egos(crowd.sumo, crowd.run_until, crowd.drivers_here, names=names, rng=rng, config=config)
        crowd.look_again()
        self._egos = [SumoEgo(name, crowd, config, speed) for name, speed in zip(names, speeds, strict=True)]
        for ego in self._egos:
            ego.begin_period(COAST)
        self._advance([COAST] * egos)  # SUMO takes the egos in with its next step
        for ego in self._egos:
            ego.start_clock()
        if len(self._driving()) < egos:
            raise SimulationError(f"the ego could not enter scenario {scenario.name!r}")
        self.first = self._snapshots()

    def step(self, commands: Sequence[EgoCommand]) -> tuple[Snapshot, ...]:
        """One decision period, cut short where the last ego collides or arrives."""
        for ego, command in zip(self._egos, commands, strict=True):
            if command.lane_change == LEAVES:
                ego.take_off()
            else:
                ego.begin_period(command)
        for _ in range(self._config.control_steps):
            if not self._driving():
                break
            self._advance(commands)
        return self._snapshots()

    def picture(self) -> Picture:
        """The road of this episode."""
        return self._crowd.picture()

    def _driving(self) -> list[SumoEgo]:
        return [ego for ego in self._egos if ego.present and not ego.removed and not self._collided[ego.name]]

    def _advance(self, commands: Sequence[EgoCommand]) -> None:
        sumo, driving = self._crowd.sumo, self._driving()
        for ego, command in zip(self._egos, commands, strict=True):
            if ego in driving:
                ego.before_step(command)
        self._crowd.step()
        arrived = set(sumo.simulation.getArrivedIDList())
        for ego in driving:
            ego.after_step(arrived=ego.name in arrived)
            if ego.present:
                self._pose[ego.name] = poses_of(sumo, [ego.name], np.array([[LENGTH_M, WIDTH_M]]))[0]
        here = [ego for ego in driving if ego.present]
        names = [ego.name for ego in here]
        for name in names:
            self._collided[name] = name in self._crowd.foreign_collided or self._overlaps(name, names)
        if self._driving():
            for ego in here:
                if self._collided[ego.name]:
                    ego.take_off()

    def _overlaps(self, name: str, here: list[str]) -> bool:
        """Does the ego's box overlap another's (SUMO looks along lanes only)."""
        mine = self._pose[name]
        egos = [self._pose[other] for other in here if other != name]
        others = np.concatenate([self._crowd.poses(), np.array(egos).reshape(-1, 7)])
        apart = np.hypot(others[:, 0] - mine[0], others[:, 1] - mine[1])
        near = others[apart < (others[:, 5] + others[:, 6] + LENGTH_M + WIDTH_M) / 2]  # a bound of the half diagonals
        if not len(near):
            return False
        box = box_corners(mine[None, :2], mine[None, 4], mine[None, 5:7])
        return bool(boxes_overlap(box, box_corners(near[:, :2], near[:, 4], near[:, 5:7])).any())

    def _snapshots(self) -> tuple[Snapshot, ...]:
        """What each ego sees: itself, the other egos that drive, and the crowd."""
        return tuple(self._snapshot(ego) for ego in self._egos)

    def _snapshot(self, ego: SumoEgo) -> Snapshot:
        crowd, rows, n = self._crowd, self._crowd.rows, len(self._egos)
        me = self._egos.index(ego)
        beside = [i for i, other in enumerate(self._egos) if i != me and other in self._driving()]
        egos = [me, *beside]
        collided = self._collided[ego.name]
        return Snapshot(
            ego=ego.state(collided=collided),
            number=np.concatenate([[0], np.array([i if i else me for i in beside], int), rows + n]).astype(np.int32),
            pose=np.concatenate([np.array([self._pose[self._egos[i].name] for i in egos]), crowd.poses()]),
            style=_led_by([-1] * len(egos), crowd.style[rows]),
            knob=_led_by([0.0] * len(egos), crowd.knob[rows]),
            decision=_led_by([NO_DECISION] * len(egos), crowd.decision[rows]),
            ran_red=_led_by([False] * len(egos), crowd.ran_red[rows]),
            crashed=_led_by([self._collided[self._egos[i].name] for i in egos], crowd.collided[rows]),
            lights=np.array(crowd.lights(), np.int8),
        )


def _led_by(first: Sequence[float | int], rest: np.ndarray) -> np.ndarray:
    """An array of the egos' values and the others'."""
    return np.concatenate([np.array(first, rest.dtype), rest])
