"""Who crosses the road in a straight line, and the tracks that it leaves among those of the traffic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.overlaps import overlaps
from stylesim.tracks import AgentKind, TrackFlag, Tracks


@dataclass(frozen=True)
class Walker:
    """A pedestrian or an animal that crosses the road in a straight line and looks at nobody."""

    name: str
    kind: AgentKind
    length_m: float  # in walking direction
    width_m: float
    start_m: tuple[float, float]
    heading_rad: float
    speed_mps: float
    begin_s: float  # of the log
    end_s: float

    @property
    def velocity_mps(self) -> tuple[float, float]:
        """While it walks."""
        return self.speed_mps * math.cos(self.heading_rad), self.speed_mps * math.sin(self.heading_rad)

    def position_m(self, time_s: float) -> tuple[float, float]:
        """Where it is then."""
        way = self.speed_mps * (time_s - self.begin_s)
        return self.start_m[0] + way * math.cos(self.heading_rad), self.start_m[1] + way * math.sin(self.heading_rad)


def _walker_tracks(walkers: Sequence[Walker], tracks: Tracks) -> Tracks:
    time_s: Float64[np.ndarray, " time"] = np.arange(tracks.n_frames) * tracks.dt_s
    begin, end = (np.array([getattr(w, name) for w in walkers])[:, None] for name in ("begin_s", "end_s"))
    valid = (time_s >= begin - 1e-9) & (time_s <= end + 1e-9)
    course, speed = (np.array([getattr(w, name) for w in walkers]) for name in ("heading_rad", "speed_mps"))
    velocity = (speed[:, None] * np.stack([np.cos(course), np.sin(course)], axis=-1))[:, None]
    place = np.array([w.start_m for w in walkers])[:, None] + (time_s - begin)[..., None] * velocity
    blank = np.where(valid, 0.0, np.nan)
    return Tracks(
        agent_id=tuple(w.name for w in walkers),
        kind=np.array([int(w.kind) for w in walkers]),
        size_m=np.array([[w.length_m, w.width_m] for w in walkers]),
        position_m=place + blank[..., None],
        velocity_mps=velocity + blank[..., None],
        heading_rad=course[:, None] + blank,
        valid=valid,
        dt_s=tracks.dt_s,
        origin_m=tracks.origin_m,
        flags=np.full(len(walkers), int(TrackFlag.STRESSOR)),
    )


def _first_hits(tracks: Tracks, walkers: int) -> list[tuple[int, int, int]]:
    """(frame, agent, walker) of the first overlap of boxes of each of the last `walkers` agents with anybody."""
    agent, frame = np.nonzero(tracks.valid)
    place, heading = tracks.position_m[agent, frame], tracks.heading_rad[agent, frame]
    found = overlaps(frame, agent, place, heading, tracks.size_m[agent])
    first: dict[int, tuple[int, int, int]] = {}
    for when, a, b in sorted(found.tolist()):
        walker = max(a, b)
        if walker >= tracks.n_agents - walkers and walker not in first:
            first[walker] = (when, min(a, b), walker)
    return list(first.values())


def with_walkers(tracks: Tracks, walkers: Sequence[Walker]) -> tuple[Tracks, int]:
    """The tracks with the walkers', and how many of them are hit: there a walker's track ends."""
    both = joined(tracks, _walker_tracks(walkers, tracks))
    hits = _first_hits(both, len(walkers))
    floats = ("position_m", "velocity_mps", "heading_rad")
    arrays: dict[str, Any] = {name: np.array(getattr(both, name)) for name in (*floats, "valid")}
    flags = np.array(both.flags)
    for frame, agent, walker in hits:
        flags[[agent, walker]] |= int(TrackFlag.COLLIDED)
        flags[walker] |= int(TrackFlag.REMOVED)
        arrays["valid"][walker, frame + 1 :] = False
        for name in floats:
            arrays[name][walker, frame + 1 :] = np.nan
    return replace(both, flags=flags, **arrays), len(hits)


def joined(one: Tracks, other: Tracks) -> Tracks:
    """The road users of both, on their common clock."""
    names = ("kind", "size_m", "position_m", "velocity_mps", "heading_rad", "valid", "flags")
    arrays: dict[str, Any] = {name: np.concatenate([getattr(one, name), getattr(other, name)]) for name in names}
    return replace(one, agent_id=one.agent_id + other.agent_id, driver=one.driver + other.driver, **arrays)
