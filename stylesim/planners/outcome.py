"""The ego in the scene of its episode: its flags, and those of whom it collided with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from stylesim.geometry import arc_length
from stylesim.planners.answers import EGO_ID
from stylesim.planners.bicycle import LENGTH_M, WIDTH_M
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind, TrackFlag, Tracks

EMERGENCY_MPS2 = -6.0  # as for every driver in SUMO's logs (`sumo.events`)


def with_ego_track(scene: Scene, rows: Float64[np.ndarray, "row 6"]) -> Scene:
    """The scene with the ego as its last track; `rows` are (frame, x, y, vx, vy, heading) in the frame of the road.

    The scene itself where the ego was in none of its frames.
    """
    tracks, frames = scene.tracks, scene.tracks.n_frames
    rows = rows[(rows[:, 0] >= 0) & (rows[:, 0] < frames)]
    if not len(rows):
        return scene
    at = rows[:, 0].astype(int)
    track = np.full((1, frames, 5), np.nan)
    track[0, at] = rows[:, 1:]
    track[0, at, :2] -= tracks.origin_m
    assert tracks.flags is not None
    joined = Tracks(
        agent_id=(*tracks.agent_id, EGO_ID),
        kind=np.append(tracks.kind, np.int8(AgentKind.CAR)),
        size_m=np.vstack([tracks.size_m, [[LENGTH_M, WIDTH_M]]]),
        position_m=np.concatenate([tracks.position_m, track[..., 0:2]]),
        velocity_mps=np.concatenate([tracks.velocity_mps, track[..., 2:4]]),
        heading_rad=np.concatenate([tracks.heading_rad, track[..., 4]]),
        valid=np.concatenate([tracks.valid, np.isfinite(track[..., 0])]),
        dt_s=tracks.dt_s,
        origin_m=tracks.origin_m,
        driver=(*tracks.driver, None),
        flags=np.append(tracks.flags, np.int32(0)),
    )
    return replace(scene, tracks=joined)


def with_ego_flags(
    scene: Scene, *, entry_point: str, hit: set[str], hardest_mps2: float, counts: Mapping[str, int]
) -> Scene:
    """The scene with what the ego did in its flags, counts and metadata."""
    tracks = scene.tracks
    about = {**scene.metadata, "ego": {"planner": entry_point}}
    scene = replace(scene, counts={**scene.counts, **counts}, metadata=about)
    if EGO_ID not in tracks.agent_id:
        return scene
    ego = tracks.agent_id.index(EGO_ID)
    assert tracks.flags is not None
    flags = tracks.flags.copy()
    flags[ego] |= TrackFlag.EGO
    if hit:
        struck = np.isin(np.array(tracks.agent_id), sorted(hit))
        flags[struck] |= TrackFlag.COLLIDED
        flags[ego] |= TrackFlag.COLLIDED
    if hardest_mps2 <= EMERGENCY_MPS2:
        flags[ego] |= TrackFlag.EMERGENCY_BRAKED
    red, yellow = crossings(scene, ego)
    flags[ego] |= TrackFlag.RAN_RED if red else 0
    flags[ego] |= TrackFlag.CROSSED_ON_YELLOW if yellow else 0
    return replace(
        scene,
        tracks=replace(tracks, flags=flags),
        counts={**scene.counts, "ego_reds_run": red, "ego_crossed_on_yellow": yellow},
    )


def crossings(scene: Scene, agent: int) -> tuple[int, int]:
    """How often the agent's front bumper crossed a stop line at red (shown for 0.1 s or more), and at yellow."""
    if scene.signals is None or scene.road is None:
        return 0, 0
    tracks = scene.tracks
    lanes = {lane.lane_id: lane for lane in scene.road.lanes}
    heading = tracks.heading_rad[agent].astype(np.float64)
    half = float(tracks.size_m[agent, 0]) / 2
    front = tracks.position_m[agent].astype(np.float64) + tracks.origin_m
    front = front + half * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    red = yellow = 0
    for row, controlled in enumerate(scene.signals.lane_id):
        state = scene.signals.state[row]
        for name in controlled:
            line = lanes[name].centre_line_m.astype(np.float64) if name in lanes else np.zeros((0, 2))
            if not len(line) or not arc_length(line)[-1] > 0:
                continue
            direction = (line[-1] - line[-2]) / max(float(np.hypot(*(line[-1] - line[-2]))), 1e-9)
            away = front - line[-1]
            along = away @ direction
            aside = np.abs(away[:, 0] * direction[1] - away[:, 1] * direction[0])
            width = 3.5 if np.isnan(lanes[name].width_m) else lanes[name].width_m
            with np.errstate(invalid="ignore"):
                crossed = np.flatnonzero((along[1:] > 0) & (along[:-1] <= 0) & (aside[1:] <= width / 2)) + 1
            for frame in crossed:
                red += bool(state[frame] == SignalState.RED and state[frame - 1] == SignalState.RED)
                yellow += bool(state[frame] == SignalState.YELLOW)
    return red, yellow
