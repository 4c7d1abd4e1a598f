"""The loop: recorded road users go on by their log, those handed over by their style."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from stylesim.randomness import stream
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.simulation.rollout.around import AHEAD_S, Others, crossing_gap_m, leader, near
from stylesim.simulation.rollout.drive import HARDEST_MPS2, Foot, behind_mps2, curve_speed_mps, idm_mps2, stopping_mps2
from stylesim.simulation.rollout.lights import Lights, stop_lines
from stylesim.simulation.rollout.path import Path
from stylesim.simulation.rollout.route import Lanes
from stylesim.style import DriverStyle
from stylesim.tracks import TrackFlag

LEAST_LIMIT_MPS = 8.0  # a limit below 30 km/h is no limit but a queue, where the map gives none
FASTEST_MPS = 60.0
TURN_M = 30.0  # through a junction; chosen
OFTEN_S = 0.3  # crossing paths are looked at so often


@dataclass
class Styled:
    """One driver who was handed over."""

    agent: int
    style: DriverStyle
    path: Path
    lights: Lights
    foot: Foot
    limit_m: Float64[np.ndarray, " point"]  # speed limit at each point of the path, m/s
    size_m: tuple[float, float]
    begin: int  # the last recorded frame
    s_m: list[float] = field(default_factory=list)  # from frame `begin` on
    speed_mps: list[float] = field(default_factory=list)
    crossing_m: float = math.inf  # place along the path where somebody else goes first


def usual_speed_mps(scene: Scene) -> float:
    """What stands for a speed limit where the map gives none: the 85 % quantile of who moves, as engineers do."""
    speed = scene.tracks.speed_mps[scene.tracks.is_motor]
    moving = speed[speed > 2.0]
    return max(LEAST_LIMIT_MPS, float(np.quantile(moving, 0.85))) if len(moving) else 50 / 3.6


class Rollout:
    """One recorded scene from one moment on; `run` steps it to the end."""

    def __init__(self, scene: Scene, lanes: Lanes, road: Road, *, seed: int, episode: int) -> None:
        self._scene, self._lanes, self._road = scene, lanes, road
        self._key = (seed, episode)
        tracks = scene.tracks
        self._dt = tracks.dt_s
        self.place = tracks.position_m.astype(np.float64)
        self.velocity = tracks.velocity_mps.astype(np.float64)
        self.heading = tracks.heading_rad.astype(np.float64)
        self.valid = tracks.valid.copy()
        self._size = np.maximum(np.nan_to_num(tracks.size_m.astype(np.float64), nan=0.5), 0.3)
        self._usual = usual_speed_mps(scene)
        self.styled: dict[int, Styled] = {}
        self._acceleration = np.zeros(tracks.n_agents)
        self.counts: Counter[str] = Counter()

    def hand_over(self, agent: int, frame: int, style: DriverStyle) -> bool:
        """From the frame after that one on the agent is a styled driver; False where no lane is beneath it."""
        place, heading = self.place[agent, frame], float(self.heading[agent, frame])
        log = self._scene.tracks
        later = np.flatnonzero(log.valid[agent, frame:])[:: max(1, round(0.5 / self._dt))] + frame
        future = log.position_m[agent, later].astype(np.float64)
        left_s = (log.n_frames - frame) * self._dt
        path = self._lanes.path(place, heading, future, least_m=FASTEST_MPS * left_s + 50.0)
        if path is None:
            return False
        (along,), _ = path.project(place[None])
        driver_id = log.agent_id[agent]
        foot = Foot(style, log.n_frames, self._dt, stream(*self._key, driver_id, "pedal"), self._braking(agent, frame))
        front = along + self._size[agent, 0] / 2
        ahead = [line for line in stop_lines(path, self._road, self._scene.signals) if line.s_m > front - 0.5]
        styled = Styled(
            agent,
            style,
            path,
            Lights(driver_id, style, self._key, self._dt, ahead),
            foot,
            self._limits(path),
            (float(self._size[agent, 0]), float(self._size[agent, 1])),
            frame,
        )
        ahead_mps = self.velocity[agent, frame] @ np.array([math.cos(heading), math.sin(heading)])
        styled.s_m.append(float(along))
        styled.speed_mps.append(max(float(ahead_mps), 0.0))
        self.styled[agent] = styled
        self.valid[agent, frame + 1 :] = False
        return True

    def _braking(self, agent: int, frame: int) -> float:
        """Its acceleration over the last half second, bounded to what people do without an emergency."""
        before = frame - max(1, round(0.5 / self._dt))
        if before < 0 or not self.valid[agent, before]:
            return 0.0
        speed = np.hypot(*self.velocity[agent, [before, frame]].T)
        return float(np.clip((speed[1] - speed[0]) / ((frame - before) * self._dt), -4.5, 3.0))

    def _limits(self, path: Path) -> Float64[np.ndarray, " point"]:
        limits = np.full(len(path.s_m), self._usual)
        for start, name in path.lanes:
            limit = self._lanes.by_id[name].speed_limit_mps
            limits[path.s_m >= start - 1e-6] = limit if np.isfinite(limit) else self._usual
        return limits

    def step(self, frame: int) -> None:
        """Everybody who is handed over moves from that frame to the next."""
        everybody = self._others(frame)
        for styled in [self.styled[agent] for agent in sorted(self.styled)]:
            if len(styled.s_m) != frame - styled.begin + 1:
                continue  # has left the map
            wish = self._wished(styled, frame, everybody)
            speed = styled.speed_mps[-1]
            pressed = styled.foot.press(wish, speed, frame)
            after = max(0.0, speed + pressed * self._dt)
            s = styled.s_m[-1] + after * self._dt
            if s > styled.path.length_m:
                self.counts["left_the_map"] += 1
                continue
            styled.s_m.append(s)
            styled.speed_mps.append(after)
            self._acceleration[styled.agent] = pressed
        for styled in self.styled.values():
            if len(styled.s_m) == frame - styled.begin + 2:
                self._place(styled, frame + 1)

    def _place(self, styled: Styled, frame: int) -> None:
        """Where it is, for the eyes of the others: on its path (wander is added in the end)."""
        place, heading = styled.path.at(np.array([styled.s_m[-1]]))
        course = np.array([math.cos(heading[0]), math.sin(heading[0])])
        self.place[styled.agent, frame], self.heading[styled.agent, frame] = place[0], heading[0]
        self.velocity[styled.agent, frame] = styled.speed_mps[-1] * course
        self.valid[styled.agent, frame] = True

    def _others(self, frame: int) -> tuple[np.ndarray, Others]:
        """Everybody in that frame, with where they will be: styled drivers along their paths, others straight on."""
        here = np.flatnonzero(self.valid[:, frame])
        ahead = self.place[here, frame][:, None] + AHEAD_S[:, None] * self.velocity[here, frame][:, None]
        rank = np.full(len(here), -1.0)
        for row, agent in enumerate(here):
            styled = self.styled.get(int(agent))
            if styled is not None and frame >= styled.begin:
                s = styled.s_m[-1]
                ahead[row], _ = styled.path.at(s + styled.speed_mps[-1] * AHEAD_S)
                rank[row] = self._rank(styled)
        return here, Others(
            self.place[here, frame],
            self.velocity[here, frame],
            self.heading[here, frame],
            self._size[here],
            self._acceleration[here],
            rank,
            ahead,
        )

    def _rank(self, styled: Styled) -> float:
        """How much its path turns ahead, rad; of two equal ones the earlier road user comes first."""
        path, s = styled.path, styled.s_m[-1]
        turn = np.interp([s, s + TURN_M], path.s_m, path.heading_rad)
        return abs(float(turn[1] - turn[0])) + 1e-6 * styled.agent

    def _wished(self, styled: Styled, frame: int, everybody: tuple[np.ndarray, Others]) -> float:
        style, path = styled.style, styled.path
        s, speed, (length, width) = styled.s_m[-1], styled.speed_mps[-1], styled.size_m
        who, all_others = everybody
        apart = Others(**{n: getattr(all_others, n)[who != styled.agent] for n in Others.__dataclass_fields__})
        others = near(apart, self.place[styled.agent, frame])
        limit = float(np.interp(s, path.s_m, styled.limit_m))
        wish = min(style.desired_speed_factor * limit, curve_speed_mps(path, s, style.comfortable_deceleration_mps2))
        free = idm_mps2(style, speed, wish)
        found = leader(path, s, length, width, others)
        result = free
        if math.isfinite(found.gap_m):
            result = behind_mps2(style, speed, free, found.speed_mps, found.acceleration_mps2, found.gap_m)
        if (frame - styled.begin) % max(1, round(OFTEN_S / self._dt)) == 0:
            gap = crossing_gap_m(
                path,
                s,
                length,
                width,
                speed,
                gap_s=style.gap_acceptance_s,
                bold_mps2=style.max_acceleration_mps2,
                rank=self._rank(styled),
                others=others,
            )
            too_late = gap <= 0 or speed**2 / (2 * max(gap, 0.1)) > HARDEST_MPS2
            styled.crossing_m = math.inf if too_late else s + length / 2 + gap
        front = s + length / 2
        line, ease = styled.lights.obstacle(frame, front, speed)
        for gap, eased in ((line, ease), (styled.crossing_m - front, style.comfortable_deceleration_mps2)):
            if math.isfinite(gap):
                result = min(result, stopping_mps2(style, speed, free, gap, eased))
        return result

    def outcome_flags(self, agent: int) -> TrackFlag:
        """What its lights saw of it."""
        return self.styled[agent].lights.flags
