"""Forecasters without learning that know the road: lane following, and a rollout of the IDM. No torch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from stylesim.forecast import Forecast, ForecastTask
from stylesim.forecasting.baselines import ConstantTurnRate, future_times_s, known_at_t0
from stylesim.forecasting.lane_paths import LanePath, matched, paths_ahead
from stylesim.geometry import project
from stylesim.kinematics import motion
from stylesim.labelers import lanes
from stylesim.labelers.options import FeatureOptions
from stylesim.signals import SignalState
from stylesim.tracks import Tracks

# IDM, Treiber, Hennecke, Helbing 2000 [recalled]: time headway 1.6 s, standstill gap 2 m, acceleration 0.73 m/s2,
# comfortable deceleration 1.67 m/s2, exponent 4.
HEADWAY_S, GAP_M, ACCELERATION_MPS2, DECELERATION_MPS2, EXPONENT = 1.6, 2.0, 0.73, 1.67, 4
HARDEST_MPS2 = 8.0  # tyres; chosen
LEAST_GAP_M = 0.1


def _speeds(tracks: Tracks) -> Float64[np.ndarray, " agent"]:
    return np.nan_to_num(tracks.speed_mps[:, -1].astype(np.float64))


class LaneFollowing:
    """Everyone keeps the speed of t0 along his lane and its successors: one mode for each way, equally probable.

    At most six, the straightest first; who is on no lane (or has no map) goes on with constant turn rate.
    """

    name = "lane_following"

    def __init__(self) -> None:
        self._options = FeatureOptions()
        self._elsewhere = ConstantTurnRate()

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """One mode per way ahead; InputError if an agent is not known at t0."""
        return [self._one(task) for task in tasks]

    def _one(self, task: ForecastTask) -> Forecast:
        speed = _speeds(known_at_t0(task))
        path = self._elsewhere.predict([task])[0].mode_m.astype(np.float64)
        index, found = matched(task, self._options)
        if index is None or found is None:
            return Forecast(path.astype(np.float32), np.ones(path.shape[:2], np.float32))
        times = future_times_s(task)
        ways = [
            [p.at(speed[agent] * times) for p in paths_ahead(task, int(agent), index, found, speed[agent] * times[-1])]
            for agent in task.agent_index
        ]
        modes = max((len(way) for way in ways), default=1) or 1
        path = np.repeat(path, modes, axis=1)
        chance = np.zeros(path.shape[:2], np.float32)
        chance[:, 0] = 1.0
        for row, way in enumerate(ways):
            if way:
                path[row, : len(way)], path[row, len(way) :] = np.stack(way), way[0]
                chance[row] = 0.0
                chance[row, : len(way)] = 1.0 / len(way)
        return Forecast(path.astype(np.float32), chance)


class IdmRollout:
    """Everyone follows his lane by the Intelligent Driver Model behind the leader of t0. One mode.

    The wished speed is the lane's limit, or the present speed where that is higher or no limit is known. A line whose
    light is red at t0 (or yellow, and can be met with comfortable braking) is a standing leader. At forks the
    straightest way; who is on no lane keeps speed and turn rate. Leaders are those of t0 throughout.
    """

    name = "idm_rollout"

    def __init__(self) -> None:
        self._options = FeatureOptions()
        self._elsewhere = ConstantTurnRate()

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """One mode per agent; InputError if an agent is not known at t0."""
        return [self._one(task) for task in tasks]

    def _one(self, task: ForecastTask) -> Forecast:
        tracks = known_at_t0(task)
        index, found = matched(task, self._options)
        run = np.where(tracks.valid, 0, -1)
        moved = motion(tracks.position_m, tracks.heading_rad, run, dt_s=tracks.dt_s, smoother=self._options.smoother)
        vehicle = tracks.valid & tracks.is_motor[:, None]
        follow = lanes.leaders(tracks, moved, found, index, is_vehicle=vehicle, options=self._options)
        speed = _speeds(tracks)
        wish, line_m = speed.copy(), np.full(len(speed), np.inf)
        ways: dict[int, LanePath] = {}
        if index is not None and found is not None:
            for agent in np.flatnonzero(found.lane[:, -1, 0] >= 0).tolist():
                limit = index.limit_mps[found.lane[agent, -1, 0]]
                wish[agent] = max(speed[agent], limit) if np.isfinite(limit) else speed[agent]
                reach = 1.2 * wish[agent] * task.future_steps * tracks.dt_s + self._options.leader_range_m
                ahead = paths_ahead(task, agent, index, found, reach)
                if ahead:
                    ways[agent] = ahead[0]
                    line_m[agent] = _held_at_m(task, agent, ahead[0], float(speed[agent]))
        along = _roll(speed, wish, follow.leader[:, -1], follow.gap_m[:, -1], line_m, task)
        path = self._elsewhere.predict([task])[0].mode_m[:, 0].astype(np.float64)
        for row, agent in enumerate(task.agent_index.tolist()):
            if agent in ways:
                path[row] = ways[agent].at(along[agent])
        return Forecast(path[:, None].astype(np.float32), np.ones((len(path), 1), np.float32))


def _held_at_m(task: ForecastTask, agent: int, path: LanePath, speed_mps: float) -> float:
    """Metres from the front bumper to the first line on the path that is held by a light; inf without one."""
    scene = task.scene
    if scene.signals is None or scene.road is None:
        return float("inf")
    shown = {lane: int(state[-1]) for ids, state in zip(scene.signals.lane_id, scene.signals.state, strict=True)
             for lane in ids}  # fmt: skip
    front = float(np.nan_to_num(scene.tracks.size_m[agent, 0])) / 2
    for name in path.lanes:
        state = shown.get(name, int(SignalState.UNKNOWN))
        lane = scene.road.lane(name)
        if state not in (SignalState.RED, SignalState.YELLOW):
            continue
        stop = lane.centre_line_m[-1] if lane.stop_line_m is None else lane.stop_line_m.mean(axis=0)
        ahead, _, _, _ = project(stop[None], path.line_m)
        left = float(ahead[0]) - front
        if left > 0 and (state == SignalState.RED or speed_mps**2 / (2 * left) <= DECELERATION_MPS2):
            return left
    return float("inf")


def _roll(
    speed: Float64[np.ndarray, " agent"],
    wish: Float64[np.ndarray, " agent"],
    leader: np.ndarray,
    gap_m: np.ndarray,
    line_m: Float64[np.ndarray, " agent"],
    task: ForecastTask,
) -> Float64[np.ndarray, "agent step"]:
    """Distance driven by every agent after each step, all at once."""
    dt = task.scene.tracks.dt_s
    v, s = speed.copy(), np.zeros(len(speed))
    led = leader >= 0
    ahead = np.where(led, leader, 0)
    gap = np.where(led, np.nan_to_num(gap_m, nan=np.inf), np.inf)
    result = np.empty((len(speed), task.future_steps))
    for step in range(task.future_steps):
        to_leader = np.where(led, gap + s[ahead] - s, np.inf)
        free = 1.0 - (v / np.maximum(wish, 0.1)) ** EXPONENT
        pull = np.minimum(
            free - _held(v, np.where(led, v[ahead], 0.0), to_leader), free - _held(v, np.zeros_like(v), line_m - s)
        )
        new = np.maximum(v + dt * np.maximum(ACCELERATION_MPS2 * pull, -HARDEST_MPS2), 0.0)
        s = s + dt * (v + new) / 2
        v = new
        result[:, step] = s
    return result


def _held(
    v: Float64[np.ndarray, " agent"], other: Float64[np.ndarray, " agent"], gap: Float64[np.ndarray, " agent"]
) -> Float64[np.ndarray, " agent"]:
    """The IDM's interaction term (s* / s)^2; 0 without anything ahead."""
    braking = 2.0 * np.sqrt(ACCELERATION_MPS2 * DECELERATION_MPS2)
    wanted = GAP_M + np.maximum(v * HEADWAY_S + v * (v - other) / braking, 0.0)
    return np.where(np.isinf(gap), 0.0, (wanted / np.maximum(gap, LEAST_GAP_M)) ** 2)
