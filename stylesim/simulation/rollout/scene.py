"""A continued scene: the log up to the moment, then the log of who was not handed over and the drive of who was."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.overlaps import overlaps
from stylesim.plausibility import implausible
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scene import Scene
from stylesim.simulation.rollout.route import Lanes
from stylesim.simulation.rollout.traffic import Rollout, Styled
from stylesim.simulation.wander import FULL_SPEED_MPS, ROOM_BEYOND_LANE_M, lateral_wander
from stylesim.style import DriverStyle
from stylesim.tracks import TrackFlag, Tracks

SOURCE = "rollout"
SETTLES_RAD_PER_S = 1.0  # how fast the recorded place in the lane gives way to the style's; chosen: a slow correction
EMERGENCY_MPS2 = 4.5  # what people brake with outside emergencies at most
USUAL_LANE_M = 3.5  # where a map gives no width
KEPT_FLAGS = TrackFlag.EGO | TrackFlag.FOCAL | TrackFlag.IMPLAUSIBLE


def continued(
    scene: Scene,
    lanes: Lanes,
    population: Population,
    *,
    at_s: float,
    drivers: frozenset[str] | None,
    seed: int,
    episode: int,
) -> Scene:
    """The recorded scene with `drivers` (None: every motor vehicle) driven by styles from the frame after `at_s` on.

    Until then every frame is the log's. With None those who come later are handed over when they appear; a driver
    without a lane beneath it stays with its log and is counted. InputError for a moment outside the scene or a driver
    that is no motor vehicle there.
    """
    road = scene.road
    if road is None:
        raise InputError(
            f"scene {scene.scene_id!r} has no road; drivers need lanes to go on (see the reader's options)"
        )
    tracks = scene.tracks
    frame = round(at_s / tracks.dt_s)
    if not 0 <= frame < tracks.n_frames - 1:
        length = tracks.n_frames * tracks.dt_s
        raise InputError(f"scene {scene.scene_id!r} lasts {length:g} s; nothing is left to drive from {at_s:g} s on")
    chosen = _chosen(scene, frame, drivers)
    rollout = Rollout(scene, lanes, road, seed=seed, episode=episode)
    draw = _drawer(population, scene, seed, episode)
    counts: Counter[str] = Counter()
    due = {agent: max(frame, int(np.argmax(tracks.valid[agent, frame:])) + frame) for agent in chosen}
    for now in range(frame, tracks.n_frames - 1):
        for agent in [agent for agent, begins in due.items() if begins == now]:
            handed = rollout.hand_over(agent, now, draw(agent))
            counts["handed_over" if handed else "without_a_lane"] += 1
        rollout.step(now)
    return _assembled(scene, rollout, counts + rollout.counts, at_s=at_s, seed=seed, episode=episode)


def _chosen(scene: Scene, frame: int, drivers: frozenset[str] | None) -> list[int]:
    tracks = scene.tracks
    if drivers is None:
        return np.flatnonzero(tracks.is_motor & tracks.valid[:, frame:].any(axis=1)).tolist()
    found = []
    for name in sorted(drivers):
        agent = tracks.agent_id.index(name) if name in tracks.agent_id else -1
        if agent < 0 or not tracks.valid[agent, frame]:
            here = [tracks.agent_id[i] for i in np.flatnonzero(tracks.valid[:, frame] & tracks.is_motor)[:8]]
            raise InputError(
                f"{name!r} is not in scene {scene.scene_id!r} at that moment; there are {', '.join(here)}, …"
            )
        if not tracks.is_motor[agent]:
            raise InputError(f"{name!r} in scene {scene.scene_id!r} is no motor vehicle; it cannot be handed over")
        found.append(agent)
    return found


def _drawer(population: Population, scene: Scene, seed: int, episode: int) -> Callable[[int], DriverStyle]:
    def draw(agent: int) -> DriverStyle:
        return population.draw(stream(seed, episode, scene.tracks.agent_id[agent], "style"))

    return draw


def _assembled(scene: Scene, rollout: Rollout, counts: Counter[str], *, at_s: float, seed: int, episode: int) -> Scene:
    log = scene.tracks
    driver: list[DriverStyle | None] = [None] * log.n_agents
    flags = np.array(log.flags) & int(KEPT_FLAGS)
    for agent, styled in rollout.styled.items():
        driver[agent] = styled.style
        hard = np.diff(styled.speed_mps, prepend=styled.speed_mps[0]) < -EMERGENCY_MPS2 * log.dt_s
        flags[agent] = int(TrackFlag(int(flags[agent])) & ~TrackFlag.IMPLAUSIBLE | rollout.outcome_flags(agent))
        flags[agent] |= int(TrackFlag.EMERGENCY_BRAKED) if hard.any() else 0
    _steer(rollout, log, seed=seed, episode=episode, key=scene.scene_id)
    invalid = ~rollout.valid
    for values in (rollout.place, rollout.velocity, rollout.heading):
        values[invalid] = np.nan
    ahead = None if log.lookahead_steps is None else np.array(log.lookahead_steps)
    for agent, styled in rollout.styled.items():
        if ahead is not None:
            ahead[agent, styled.begin + 1 :] = 0
    tracks = replace(
        log,
        position_m=rollout.place.astype(np.float32),
        velocity_mps=rollout.velocity.astype(np.float32),
        heading_rad=rollout.heading.astype(np.float32),
        valid=rollout.valid,
        driver=tuple(driver),
        flags=flags,
        lookahead_steps=ahead,
    )
    tracks, hit = _with_collisions(tracks, set(rollout.styled), round(at_s / log.dt_s))
    contradicted = np.where(implausible(tracks).agents, np.int32(TrackFlag.IMPLAUSIBLE), np.int32(0))
    assert tracks.flags is not None
    said: dict[str, Any] = {
        "at_s": at_s,
        "drivers": sorted(log.agent_id[agent] for agent in rollout.styled),
        "episode": episode,
        "seed": seed,
    }
    blind = 0 if scene.signals is None else sum(not lanes for lanes in scene.signals.lane_id)
    names = ("handed_over", "without_a_lane", "left_the_map")
    return replace(
        scene,
        scene_id=f"{scene.scene_id}-from{at_s:g}s-{seed}-{episode:05d}",
        source=SOURCE,
        source_scenario_id="",
        tracks=replace(tracks, flags=tracks.flags | contradicted),
        replay_of=scene.scene_id,
        counts={**{name: counts[name] for name in names}, "lights_without_lanes": blind, "collisions": hit},
        parameters={},
        metadata={"from_recording": said},
        t0_frame=None,
    )


def _steer(rollout: Rollout, log: Tracks, *, seed: int, episode: int, key: str) -> None:
    """The lateral part: from the recorded place in the lane over to the style's wander, then velocity and heading."""
    styled = list(rollout.styled.values())
    if not styled:
        return
    frames = max(len(one.s_m) for one in styled)
    speed = np.zeros((len(styled), frames))
    for row, one in enumerate(styled):
        speed[row, : len(one.s_m)] = one.speed_mps
    wander = lateral_wander(
        [one.style for one in styled],
        speed,
        limit_m=np.array([max((USUAL_LANE_M - one.size_m[1]) / 2 + ROOM_BEYOND_LANE_M, 0.0) for one in styled]),
        dt_s=log.dt_s,
        streams=[stream(seed, episode, log.agent_id[one.agent], "wander") for one in styled],
    )
    for row, one in enumerate(styled):
        _place(rollout, one, wander[row, : len(one.s_m)], log.dt_s)


def _place(rollout: Rollout, one: Styled, wander: np.ndarray, dt_s: float) -> None:
    agent, frames = one.agent, slice(one.begin, one.begin + len(one.s_m))
    start = rollout.place[agent, one.begin].copy()
    s, speed = np.array(one.s_m), np.array(one.speed_mps)
    place, heading = one.path.at(s)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    gone = start - place[0]
    pace = np.concatenate([[0.0], dt_s * np.minimum(1.0, speed[1:] / FULL_SPEED_MPS)])
    fade = np.cumsum(pace) * SETTLES_RAD_PER_S
    fade = (1.0 + fade) * np.exp(-fade)
    offset = fade * (float(gone @ left[0]) - wander[0]) + wander
    course0 = np.array([np.cos(heading[0]), np.sin(heading[0])])
    centre = place + offset[:, None] * left + (fade * float(gone @ course0))[:, None] * course0
    velocity = np.diff(centre, axis=0) / dt_s
    moving = speed[1:] > 0.5
    turned = np.where(moving, np.arctan2(velocity[:, 1], velocity[:, 0]), np.nan)
    steered = wrap_angle(turned - heading[1:])
    first = float(wrap_angle(np.array(rollout.heading[agent, one.begin] - heading[0])))
    slip = _held(np.clip(steered, -0.35, 0.35), first)
    later = slice(frames.start + 1, frames.stop)
    rollout.place[agent, later], rollout.velocity[agent, later] = centre[1:], velocity
    rollout.heading[agent, later] = wrap_angle(heading[1:] + slip)


def _held(values: np.ndarray, first: float) -> np.ndarray:
    """The values, where there is none the last one before."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(1, len(values) + 1), 0))
    return np.concatenate([[first], values])[last]


def _with_collisions(tracks: Tracks, styled: set[int], frame: int) -> tuple[Tracks, int]:
    """Who touches a styled driver after the moment, flagged; and how many pairs."""
    agent, when = np.nonzero(tracks.valid[:, frame + 1 :])
    when = when + frame + 1
    size = np.nan_to_num(tracks.size_m, nan=0.5)
    found = overlaps(when, agent, tracks.position_m[agent, when], tracks.heading_rad[agent, when], size[agent])
    pairs = {(min(a, b), max(a, b)) for _, a, b in found.tolist() if a in styled or b in styled}
    flags = np.array(tracks.flags)
    flags[sorted({agent for pair in pairs for agent in pair})] |= int(TrackFlag.COLLIDED)
    return replace(tracks, flags=flags), len(pairs)
