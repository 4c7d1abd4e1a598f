"""Several controlled vehicles among styled drivers: every scenario of the catalogue as a PettingZoo `ParallelEnv`."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from jaxtyping import Float32, UInt8
from pettingzoo import ParallelEnv

from stylesim.envs.action import ActionDecoder
from stylesim.envs.base import MAX_SEED
from stylesim.envs.catalogue import KINDS, open_world
from stylesim.envs.config import ActionType, EnvConfig, configured
from stylesim.envs.crowd import RESET_OPTIONS, Crowd, place_of, resolved_population
from stylesim.envs.info import described
from stylesim.envs.observation import Layout
from stylesim.envs.render import Renderer
from stylesim.envs.reward import cost_terms, reward_terms
from stylesim.envs.world import LEAVE, EgoCommand, Snapshot, World
from stylesim.errors import InputError, unknown
from stylesim.population import Population
from stylesim.scenario import Scenario

LARGEST_TEAM = 32  # chosen, because each controlled vehicle takes over a driver, and more are seldom on the road
ALIKE = 0.75  # chosen, because `populaton` is 0.95 alike, and `options` 0.59
Observation = Float32[np.ndarray, " value"]
Step = tuple[
    dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
]  # fmt: skip


def _sorted_out(options: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The options that are ours (or nearly: those are refused later), and the names of the others."""
    ours = {k: v for k, v in options.items() if difflib.get_close_matches(str(k), RESET_OPTIONS, cutoff=ALIKE)}
    return ours, tuple(str(key) for key in options if key not in ours)


class ParallelDrivingEnv(ParallelEnv[str, Observation, Any]):  # type: ignore[misc]
    """`agents` controlled vehicles (`car_0`, `car_1`, …), each with observation, actions and reward of `DrivingEnv`.

    They see each other as vehicles of unknown style. Who collides, arrives or (with `ends_on_red`) runs a red light is
    terminated and taken off the road, the others go on; when `duration_s` is over all are truncated.
    """

    def __init__(
        self,
        scenario: str | Scenario,
        *,
        agents: int = 3,
        population: str | Population | None = None,
        styles: str | Mapping[str, float] | None = None,
        action_type: ActionType = "discrete",
        observe_style: bool = False,
        config: Mapping[str, Any] | EnvConfig | None = None,
        render_mode: str | None = None,
    ) -> None:
        if isinstance(agents, bool) or not isinstance(agents, int) or not 1 <= agents <= LARGEST_TEAM:
            raise InputError(f"agents must be a whole number from 1 to {LARGEST_TEAM}, not {agents!r}")
        place = place_of(scenario)
        kind = KINDS[place.backend]
        self.metadata = {
            "name": f"stylesim_{place.name}_v0",
            "render_modes": kind.metadata["render_modes"],
            "is_parallelizable": True,
        }
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise unknown("render mode", str(render_mode), self.metadata["render_modes"])
        self.config = configured(config, where="config", **kind.defaults)
        if self.config.entry == "yellow" and agents > 1:
            raise InputError("entry 'yellow' is for one ego; several take over drivers with entry 'traffic'")
        self.metadata["render_fps"] = max(1, round(1.0 / self.config.period_s))
        self.render_mode = render_mode
        self._crowd = Crowd(resolved_population(population, styles), place)
        self._frame = (kind.frame_px, kind.px_per_m)
        self.layout = Layout(self.config.neighbours, self.config.perception_m, observe_style)
        self.possible_agents = [f"car_{number}" for number in range(agents)]
        self.agents: list[str] = []
        self._decoders = {agent: ActionDecoder(action_type, self.config) for agent in self.possible_agents}
        self.observation_spaces = dict.fromkeys(self.possible_agents, self.layout.space)
        self.action_spaces = {agent: decoder.space for agent, decoder in self._decoders.items()}
        self._rng, _ = seeding.np_random()
        self._world: World | None = None
        self._seen: dict[str, Snapshot] = {}
        self._renderer: Renderer | None = None

    def observation_space(self, agent: str) -> gym.spaces.Space[Any]:
        """The observation space of an agent: the same object at every call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gym.spaces.Space[Any]:
        """The action space of an agent: the same object at every call."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """A new episode; `options` may set population or styles, and scenario, for this episode only.

        PettingZoo asks environments to take options that they do not know: those are named in `info["episode"]`;
        what looks like a misspelt option of ours is refused with an InputError.
        """
        if seed is not None:
            self._rng, _ = seeding.np_random(seed)
        ours, ignored = _sorted_out(options or {})
        crowd = self._crowd.changed(ours, backend=self._crowd.scenario.backend)
        if self._world is None:
            self._world = open_world(crowd.scenario.backend, self.config, egos=len(self.possible_agents))
        episode_seed = int(self._rng.integers(MAX_SEED))
        self.agents = []
        snapshots = self._world.reset(scenario=crowd.scenario, population=crowd.population, seed=episode_seed)
        self.agents = list(self.possible_agents)
        self._seen = dict(zip(self.agents, snapshots, strict=True))
        self._renderer = None
        about: dict[str, Any] = {"population": crowd.population.name, "scenario": crowd.scenario.name}
        about |= {"seed": episode_seed, "ignored_options": ignored}
        observations, infos = {}, {}
        for agent, snapshot in self._seen.items():
            self._decoders[agent].reset(snapshot.ego.speed_mps)
            observations[agent], infos[agent] = self._told(snapshot)
            infos[agent]["episode"] = about
        return observations, infos

    def step(self, actions: Mapping[str, Any]) -> Step:
        """One decision period. InputError before the first reset, after the end, for a missing or a bad action."""
        if not self.agents or self._world is None:
            raise InputError("there is no running episode; call reset() first")
        acting = self.agents
        for agent in acting:
            if agent not in actions:
                raise InputError(f"there is no action for agent {agent!r}; every one of {', '.join(acting)} needs one")
        snapshots = self._world.step([self._command(agent, actions) for agent in self.possible_agents])
        now = dict(zip(self.possible_agents, snapshots, strict=True))
        self._seen = {agent: now[agent] for agent in acting}
        observations, rewards, ended, cut, infos = {}, {}, {}, {}, {}
        for agent, snapshot in self._seen.items():
            ego = snapshot.ego
            terms, costs = reward_terms(ego, self.config), cost_terms(snapshot, self.config)
            observations[agent], infos[agent] = self._told(snapshot)
            infos[agent] |= {"reward_terms": terms, "cost": sum(costs.values()), "cost_terms": costs}
            rewards[agent] = sum(terms.values())
            ended[agent] = bool(ego.collided or ego.arrived or (self.config.ends_on_red and ego.reds_run))
            cut[agent] = not ended[agent] and ego.time_s >= self.config.duration_s - 1e-6
        self.agents = [agent for agent in acting if not (ended[agent] or cut[agent])]
        return observations, rewards, ended, cut, infos

    def _command(self, agent: str, actions: Mapping[str, Any]) -> EgoCommand:
        if agent not in self.agents:
            return LEAVE
        return self._decoders[agent].command(actions[agent], self._seen[agent].ego.speed_mps)

    def _told(self, snapshot: Snapshot) -> tuple[Observation, dict[str, Any]]:
        rows = self.layout.nearest(snapshot)
        return self.layout.encode(snapshot, rows, self.config), described(snapshot, rows, self.layout.neighbours)

    def render(self) -> UInt8[np.ndarray, "height width 3"] | None:
        """The scene around the first agent that still drives, [height, width, 3], uint8; None without a render mode."""
        if self.render_mode is None:
            return None
        if not self._seen or self._world is None:
            raise InputError("there is nothing to render yet; call reset() first")
        if self._renderer is None:
            size, scale = self._frame
            self._renderer = Renderer(self._world.picture(), size_px=size, px_per_m=scale)
        centre = self.agents[0] if self.agents else next(iter(self._seen))
        return self._renderer.frame(self._seen[centre])

    def close(self) -> None:
        """End the simulation; twice does no harm."""
        if self._world is not None:
            self._world.close()
        self._world, self._seen, self._renderer, self.agents = None, {}, None, []
