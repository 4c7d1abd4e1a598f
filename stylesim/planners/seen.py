"""What has been seen so far, as the `Scene` that a planner is given."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int8

from stylesim.planners.answers import EGO_ID
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.signals import Signals
from stylesim.tracks import TrackFlag, Tracks

HISTORY_S = 2.0  # REFERENCE section 4: histories of 1 to 2 s are usual; chosen at the long end


@dataclass(frozen=True, eq=False)
class Frame:
    """Everybody at one moment; row 0 is the ego. Box centres, in the frame of the road."""

    agent_id: tuple[str, ...]
    kind: Int8[np.ndarray, " agent"]
    size_m: Float64[np.ndarray, "agent 2"]
    pose: Float64[np.ndarray, "agent 5"]  # x, y, vx, vy, heading
    lights: Int8[np.ndarray, " light"]


@dataclass(frozen=True)
class Place:
    """What does not change during an episode."""

    scene_id: str
    source: str
    scenario: str
    road: Road | None
    light_id: tuple[str, ...] = ()
    light_lanes: tuple[tuple[str, ...], ...] = ()
    dt_s: float = 0.1


class Memory:
    """The last 2 s, frame by frame."""

    def __init__(self, place: Place) -> None:
        self._place = place
        self._frames: deque[Frame] = deque(maxlen=round(HISTORY_S / place.dt_s))
        self._seen = 0

    def add(self, frame: Frame) -> None:
        """The next frame."""
        self._frames.append(frame)
        self._seen += 1

    def scene(self) -> Scene:
        """The frames in memory: who is there now or was in them, the ego first, without styles."""
        frames, place = self._frames, self._place
        names = [EGO_ID]
        row: dict[str, int] = {EGO_ID: 0}
        for frame in reversed(frames):
            for name in frame.agent_id:
                if name not in row:
                    row[name] = len(names)
                    names.append(name)
        n, steps = len(names), len(frames)
        pose = np.full((n, steps, 5), np.nan)
        size, kind = np.zeros((n, 2)), np.zeros(n, np.int8)
        for t, frame in enumerate(frames):
            at = [row[name] for name in frame.agent_id]
            pose[at, t] = frame.pose
            size[at], kind[at] = frame.size_m, frame.kind
        flags = np.zeros(n, np.int32)
        flags[0] = TrackFlag.EGO
        tracks = Tracks(
            agent_id=tuple(names),
            kind=kind,
            size_m=size,
            position_m=pose[..., 0:2],
            velocity_mps=pose[..., 2:4],
            heading_rad=pose[..., 4],
            valid=np.isfinite(pose[..., 0]),
            dt_s=place.dt_s,
            flags=flags,
        )
        signals = None
        if place.light_id:
            states = np.stack([frame.lights for frame in frames], axis=1)
            signals = Signals(place.light_id, place.light_lanes, states)
        return Scene(
            scene_id=place.scene_id,
            unit_id=place.scene_id,
            source=place.source,
            scenario=place.scenario,
            tracks=tracks,
            road=place.road,
            signals=signals,
            start_s=(self._seen - steps) * place.dt_s,
        )
