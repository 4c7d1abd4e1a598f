"""Small scenes whose features can be worked out by hand, and traffic to fit on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.tracks import AgentKind, Tracks

DT_S = 0.1
LANE_M = 3.5


def clock(frames: int = 110) -> np.ndarray:
    return np.arange(frames) * DT_S


def lanes(count: int = 2, *, start: float = -200.0, stop: float = 1500.0, limit: float = 13.9) -> Road:
    """Parallel lanes eastward; the first lies on the x axis, the next to its left."""
    line, left = np.array([[start, 0.0], [stop, 0.0]]), np.array([0.0, LANE_M])
    return Road(tuple(Lane(f"lane{i}", line + i * left, width_m=LANE_M, speed_limit_mps=limit) for i in range(count)))


def scene_of(
    paths: Sequence[np.ndarray],
    *,
    road: Road | None = None,
    kinds: Sequence[AgentKind] | None = None,
    headings: Sequence[float] | None = None,
    name: str = "made",
) -> Scene:
    """A scene from paths [time 2]; NaN where an agent is absent. Headings follow the path unless given."""
    position = np.stack(paths)
    n = len(paths)
    velocity = np.gradient(position, DT_S, axis=1)
    heading = np.arctan2(velocity[..., 1], velocity[..., 0])
    if headings is not None:
        heading = np.repeat(np.array(headings, float)[:, None], position.shape[1], axis=1)
    valid = np.isfinite(position).all(axis=-1)
    for array in (velocity, heading):
        array[~valid] = np.nan
    velocity[np.isnan(velocity) & valid[..., None]] = 0.0
    heading[np.isnan(heading) & valid] = 0.0
    tracks = Tracks(
        agent_id=tuple(f"car-{i}" for i in range(n)),
        kind=np.array(kinds or [AgentKind.CAR] * n, np.int8),
        size_m=np.tile(np.float32([4.5, 1.8]), (n, 1)),
        position_m=position.astype(np.float32),
        velocity_mps=velocity.astype(np.float32),
        heading_rad=heading.astype(np.float32),
        valid=valid,
        dt_s=DT_S,
    )
    return Scene(scene_id=name, unit_id=name, source="made", scenario="made", tracks=tracks, road=road)


def straight(x0: float, speed: float, y: float = 0.0, *, frames: int = 110) -> np.ndarray:
    t = clock(frames)
    return np.stack([x0 + speed * t, np.full(frames, y)], axis=1)


def traffic(name: str = "traffic", *, agents: int = 40, frames: int = 230, seed: int = 0, limit: float = 13.9) -> Scene:
    """Wandering drivers of different speeds on three lanes; half of them change lanes."""
    rng = np.random.default_rng(seed)
    t = clock(frames)
    paths = []
    for i in range(agents):
        speed = rng.uniform(7, 14) + rng.uniform(0.1, 2.5) * np.sin(rng.uniform(0.1, 0.8) * t + rng.uniform(0, 6))
        move = rng.integers(-1, 2) / (1 + np.exp(-2 * (t - rng.uniform(3, 18))))
        y = LANE_M * np.clip(i % 3 + move, 0, 2) + rng.uniform(0, 0.5) * np.sin(0.6 * t + rng.uniform(0, 6))
        paths.append(np.stack([25.0 * (i // 3) + np.cumsum(speed) * DT_S, y], axis=1))
    return scene_of(paths, road=lanes(3, limit=limit), name=name)


def turned(scene: Scene, angle_rad: float, shift_m: tuple[float, float]) -> Scene:
    """The scene after a rigid motion."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    matrix = np.array([[c, s], [-s, c]])
    tracks = scene.tracks
    moved = replace(
        tracks,
        position_m=(tracks.position_m.astype(np.float64) @ matrix + shift_m).astype(np.float32),
        velocity_mps=(tracks.velocity_mps.astype(np.float64) @ matrix).astype(np.float32),
        heading_rad=(tracks.heading_rad + np.float32(angle_rad)).astype(np.float32),
    )
    assert scene.road is not None
    road = Road(
        tuple(
            replace(lane, centre_line_m=(lane.centre_line_m.astype(np.float64) @ matrix + shift_m).astype(np.float32))
            for lane in scene.road.lanes
        )
    )
    return replace(scene, tracks=moved, road=road)


def reordered(scene: Scene, order: np.ndarray) -> Scene:
    """The same agents in another order."""
    tracks = scene.tracks
    names = ("kind", "size_m", "position_m", "velocity_mps", "heading_rad", "valid", "flags")
    moved = replace(
        tracks,
        agent_id=tuple(tracks.agent_id[i] for i in order),
        driver=tuple(tracks.driver[i] for i in order),
        **{name: getattr(tracks, name)[order] for name in names},
    )
    return replace(scene, tracks=moved)
