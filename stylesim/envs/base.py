"""`DrivingEnv`: one ego among styled drivers, the same face whatever simulator stands behind it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from jaxtyping import Float32, UInt8

from stylesim.envs.action import ActionDecoder
from stylesim.envs.config import ActionType, EnvConfig, configured
from stylesim.envs.crowd import Crowd, resolved_population, resolved_scenario
from stylesim.envs.info import described
from stylesim.envs.observation import Layout
from stylesim.envs.render import Renderer
from stylesim.envs.reward import cost_terms, reward_terms
from stylesim.envs.world import Snapshot, World
from stylesim.errors import InputError, unknown
from stylesim.population import Population
from stylesim.scenario import Scenario

MAX_SEED = 2**31 - 1  # SUMO's --seed is a signed 32-bit integer


class DrivingEnv(gym.Env[Float32[np.ndarray, " value"], Any]):
    """One ego among drivers of a population; abstract: a subclass says which simulator.

    `population` (name, path or `Population`) or `styles` (shares that sum to 1) choose the crowd, `scenario` the
    place; `action_type` is "discrete" (highway-env's meta-actions) or "continuous"; `observe_style` adds the
    neighbours' true style to the observation; `config` changes what `EnvConfig` holds. docs/environments.md
    documents observation, reward, cost and the rules of the end. InputError for names and values that do not fit.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 5}  # noqa: RUF012  # Gymnasium's own
    backend: ClassVar[str]
    default_scenario: ClassVar[str]
    defaults: ClassVar[dict[str, Any]] = {}
    frame_px: ClassVar[tuple[int, int]] = (600, 600)  # width, height
    px_per_m: ClassVar[float] = 5.0

    def __init__(
        self,
        *,
        population: str | Population | None = None,
        styles: str | Mapping[str, float] | None = None,
        scenario: str | Scenario | None = None,
        action_type: ActionType = "discrete",
        observe_style: bool = False,
        config: Mapping[str, Any] | EnvConfig | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.config = configured(config, where="config", **self.defaults)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise unknown("render mode", str(render_mode), self.metadata["render_modes"])
        self.render_mode = render_mode
        place = resolved_scenario(scenario or self.default_scenario, backend=self.backend)
        self._crowd = Crowd(resolved_population(population, styles), place)
        self._decoder = ActionDecoder(action_type, self.config)
        self.layout = Layout(self.config.neighbours, self.config.perception_m, observe_style)
        self.observation_space = self.layout.space
        self.action_space = self._decoder.space
        self.metadata = {**type(self).metadata, "render_fps": max(1, round(1.0 / self.config.period_s))}
        self._world: World | None = None
        self._snapshot: Snapshot | None = None
        self._renderer: Renderer | None = None
        self._over = False

    def _make_world(self) -> World:
        """The simulation, made at the first reset."""
        raise NotImplementedError

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32[np.ndarray, " value"], dict[str, Any]]:
        """A new episode; `options` may set population or styles, and scenario, for this episode only."""
        super().reset(seed=seed)
        crowd = self._crowd.changed(options, backend=self.backend)
        if self._world is None:
            self._world = self._make_world()
        episode_seed = int(self.np_random.integers(MAX_SEED))
        (self._snapshot,) = self._world.reset(scenario=crowd.scenario, population=crowd.population, seed=episode_seed)
        self._decoder.reset(self._snapshot.ego.speed_mps)
        self._renderer, self._over = None, False
        observation, info = self._seen(self._snapshot)
        info["episode"] = {"population": crowd.population.name, "scenario": crowd.scenario.name, "seed": episode_seed}
        return observation, info

    def step(self, action: Any) -> tuple[Float32[np.ndarray, " value"], float, bool, bool, dict[str, Any]]:
        """One decision period. InputError before the first reset, after the end, or for a bad action."""
        if self._snapshot is None or self._world is None or self._over:
            raise InputError("there is no running episode; call reset() first")
        command = self._decoder.command(action, self._snapshot.ego.speed_mps)
        (self._snapshot,) = self._world.step([command])
        ego = self._snapshot.ego
        terms, costs = reward_terms(ego, self.config), cost_terms(self._snapshot, self.config)
        observation, info = self._seen(self._snapshot)
        info |= {"reward_terms": terms, "cost": sum(costs.values()), "cost_terms": costs}
        terminated = bool(ego.collided or ego.arrived or (self.config.ends_on_red and ego.reds_run))
        truncated = not terminated and ego.time_s >= self.config.duration_s - 1e-6
        self._over = terminated or truncated
        return observation, sum(terms.values()), terminated, truncated, info

    def _seen(self, snapshot: Snapshot) -> tuple[Float32[np.ndarray, " value"], dict[str, Any]]:
        rows = self.layout.nearest(snapshot)
        return self.layout.encode(snapshot, rows, self.config), described(snapshot, rows, self.layout.neighbours)

    def render(self) -> UInt8[np.ndarray, "height width 3"] | None:
        """The scene around the ego as an array [height, width, 3] of uint8; None without a render mode."""
        if self.render_mode is None:
            return None
        if self._snapshot is None or self._world is None:
            raise InputError("there is nothing to render yet; call reset() first")
        if self._renderer is None:
            self._renderer = Renderer(self._world.picture(), size_px=self.frame_px, px_per_m=self.px_per_m)
        return self._renderer.frame(self._snapshot)

    def close(self) -> None:
        """End the simulation; twice does no harm."""
        if self._world is not None:
            self._world.close()
        self._world, self._snapshot, self._renderer = None, None, None
