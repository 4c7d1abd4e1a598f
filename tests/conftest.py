"""Fixtures that every part uses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.signals import Signals, SignalState
from stylesim.styles import style_table
from stylesim.tracks import AgentKind, Tracks

ROOT = Path(__file__).resolve().parent.parent


def make_scene(
    scene_id: str = "scene-0",
    *,
    n_agents: int = 5,
    n_frames: int = 130,
    seed: int = 0,
    unit_id: str | None = None,
    with_road: bool = True,
    source: str = "made",
) -> Scene:
    """Cars on two straight lanes with gently varying speed; the last one comes late and leaves early."""
    rng = np.random.default_rng(seed)
    dt, t = 0.1, np.arange(n_frames) * 0.1
    lane_y = np.where(np.arange(n_agents) % 2 == 0, 0.0, 3.5)
    base = rng.uniform(8, 14, n_agents)[:, None]
    speed = base + 1.5 * np.sin(0.5 * t[None] + rng.uniform(0, 6, n_agents)[:, None])
    x = np.cumsum(speed, axis=1) * dt + 25.0 * np.arange(n_agents)[:, None]
    wander = 0.2 * np.sin(0.7 * t[None] + rng.uniform(0, 6, n_agents)[:, None])
    y = lane_y[:, None] + wander
    position = np.stack([x, y], axis=-1)
    velocity = np.stack([speed, np.gradient(y, dt, axis=1)], axis=-1)
    heading = np.arctan2(velocity[..., 1], velocity[..., 0])
    valid = np.ones((n_agents, n_frames), bool)
    valid[-1, : n_frames // 4] = False
    valid[-1, -n_frames // 4 :] = False
    for array in (position, velocity, heading):
        array[~valid] = np.nan
    drivers = tuple(style_table().at(float(a)) for a in rng.uniform(-1, 1, n_agents))
    tracks = Tracks(
        agent_id=tuple(f"car-{i}" for i in range(n_agents)),
        kind=np.full(n_agents, AgentKind.CAR),
        size_m=np.tile([4.5, 1.8], (n_agents, 1)),
        position_m=position,
        velocity_mps=velocity,
        heading_rad=heading,
        valid=valid,
        dt_s=dt,
        origin_m=np.array([604755.0, 5792823.0]),
        driver=drivers,
    )
    road, signals = None, None
    if with_road:
        line = np.stack([np.linspace(-50, 600, 66), np.zeros(66)], axis=1)
        right = Lane("right", line, width_m=3.5, speed_limit_mps=13.9, left_neighbour="left")
        left = Lane("left", line + np.array([0.0, 3.5]), width_m=3.5, speed_limit_mps=13.9, right_neighbour="right")
        road = Road((right, left))
        state = np.full((1, n_frames), SignalState.GREEN)
        state[:, n_frames // 2 :] = SignalState.YELLOW
        state[:, -n_frames // 4 :] = SignalState.RED
        signals = Signals(("light",), (("right", "left"),), state)
    return Scene(
        scene_id=scene_id,
        unit_id=unit_id or scene_id,
        source=source,
        scenario="straight",
        tracks=tracks,
        road=road,
        signals=signals,
        counts={"collisions": seed % 2},
        parameters={"speed_limit_mps": 13.9},
    )


@pytest.fixture
def scene() -> Scene:
    return make_scene()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings beside the project; tests that need it skip where it is missing."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"the recordings are not here: {folder}")
    return folder
