"""Forecasters without learning: what any model has to beat. No torch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32, Float64

from stylesim.errors import InputError
from stylesim.forecast import Forecast, ForecastTask
from stylesim.geometry import wrap_angle
from stylesim.tracks import Tracks

TURN_WINDOW_S = 1.0  # chosen: long enough to average out heading noise, short enough to see a turn begin
TURN_MIN_SPEED_MPS = 1.0  # chosen: below it a recorded heading turns without the vehicle turning


def known_at_t0(task: ForecastTask) -> Tracks:
    """The tracks of the task; InputError if an agent to forecast is not known at t0."""
    tracks = task.scene.tracks
    for index in task.agent_index:
        if not tracks.valid[index, -1]:
            raise InputError(
                f"scene {task.scene.scene_id!r}: agent {tracks.agent_id[index]!r} is not known at t0 (frame "
                f"{task.t0_frame}); choose the agents with windows.target_agents"
            )
    return tracks


def future_times_s(task: ForecastTask) -> Float64[np.ndarray, " time"]:
    """Seconds from t0 to each step that is asked for."""
    return np.arange(1, task.future_steps + 1) * task.scene.tracks.dt_s


def _one_mode(path_m: Float64[np.ndarray, "driver time 2"]) -> Forecast:
    return Forecast(path_m[:, None].astype(np.float32), np.ones((len(path_m), 1), np.float32))


class ConstantVelocity:
    """Everyone goes on with the velocity of t0, straight ahead. One mode."""

    name = "constant_velocity"

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """One straight mode per agent; InputError if an agent is not known at t0."""
        return [self._one(task) for task in tasks]

    def _one(self, task: ForecastTask) -> Forecast:
        tracks = known_at_t0(task)
        start = tracks.position_m[task.agent_index, -1].astype(np.float64)
        velocity = tracks.velocity_mps[task.agent_index, -1].astype(np.float64)
        return _one_mode(start[:, None] + velocity[:, None] * future_times_s(task)[None, :, None])


class ConstantTurnRate:
    """Everyone keeps the speed of t0 and the mean turn rate of the last second. One mode, an arc."""

    name = "constant_turn_rate"

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """One arc per agent; InputError if an agent is not known at t0."""
        return [self._one(task) for task in tasks]

    def _one(self, task: ForecastTask) -> Forecast:
        tracks = known_at_t0(task)
        index = task.agent_index
        start = tracks.position_m[index, -1].astype(np.float64)
        velocity = tracks.velocity_mps[index, -1].astype(np.float64)
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        rate = np.where(speed >= TURN_MIN_SPEED_MPS, turn_rate_radps(tracks)[index], 0.0)
        t = future_times_s(task)[None]
        # Integral of the velocity turning at `rate`: v0 times (sin, 1 - cos)(rate t) / rate, by series near 0.
        angle = rate[:, None] * t
        along = t * np.sinc(angle / np.pi)
        across = t * np.sinc(angle / (2 * np.pi)) * np.sin(angle / 2)
        vx, vy = velocity[:, :1], velocity[:, 1:]
        step = np.stack([vx * along - vy * across, vy * along + vx * across], axis=-1)
        return _one_mode(start[:, None] + step)


def turn_rate_radps(tracks: Tracks) -> Float32[np.ndarray, " agent"]:
    """Mean turn rate over the last TURN_WINDOW_S, rad/s; 0 where the agent was not known throughout."""
    steps = min(max(1, round(TURN_WINDOW_S / tracks.dt_s)), tracks.n_frames - 1)
    if steps < 1:
        return np.zeros(tracks.n_agents, np.float32)
    turned = wrap_angle(np.diff(tracks.heading_rad[:, -steps - 1 :], axis=1)).sum(axis=1)
    known = tracks.valid[:, -steps - 1 :].all(axis=1)
    return np.where(known, turned / (steps * tracks.dt_s), 0.0).astype(np.float32)
