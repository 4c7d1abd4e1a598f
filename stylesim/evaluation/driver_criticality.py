"""How critical each driver's encounters were: time to collision, headway, required deceleration, encroachment."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.corpus import Corpus
from stylesim.evaluation.collisions import collisions_of
from stylesim.evaluation.following import following
from stylesim.kinematics import encroachments, required_deceleration_mps2, time_headway_s
from stylesim.kinematics import time_to_collision_s as time_to_collision
from stylesim.scene import Scene

# What counts as a conflict [recalled: Hayward 1972, Allen et al. 1978, Archer 2005; all widely used].
CRITICAL_TTC_S = 1.5
CRITICAL_PET_S = 1.0
CRITICAL_DECELERATION_MPS2 = 3.35
MOVING_MPS = 2.0  # chosen: in a standing queue a headway in seconds says nothing
INNER = 5.0  # percent
NOBODY = "none"  # style of who was not commanded: recorded drivers, the ego, pedestrians


@dataclass(frozen=True, eq=False)
class DriverCriticality:
    """One row per motor vehicle of a corpus. Times are NaN where there was no such encounter.

    `ttc` over the frames in which it closes on its leader, `headway` over those in which it follows moving, both within
    100 m; `pet_min_s` over all encounters on crossing ways, whether it came first or second. Counts are of encounters
    (an unbroken stretch behind one leader; one ordered pair). `collisions_charged` counts collisions it is charged
    with (`collisions`), but for those under a stressor; `in_collisions` all that it was part of.
    """

    scene_id: tuple[str, ...]
    agent_id: tuple[str, ...]
    unit: tuple[str, ...]
    source: tuple[str, ...]
    scenario: tuple[str, ...]
    style: tuple[str, ...]
    km: Float64[np.ndarray, " driver"]
    hours: Float64[np.ndarray, " driver"]
    ttc_min_s: Float64[np.ndarray, " driver"]
    ttc_p5_s: Float64[np.ndarray, " driver"]
    headway_min_s: Float64[np.ndarray, " driver"]
    headway_p5_s: Float64[np.ndarray, " driver"]
    deceleration_max_mps2: Float64[np.ndarray, " driver"]
    pet_min_s: Float64[np.ndarray, " driver"]
    ttc_conflicts: Int64[np.ndarray, " driver"]
    deceleration_conflicts: Int64[np.ndarray, " driver"]
    pet_conflicts: Int64[np.ndarray, " driver"]
    collisions_charged: Int64[np.ndarray, " driver"]
    in_collisions: Int64[np.ndarray, " driver"]

    def __len__(self) -> int:
        """Number of drivers."""
        return len(self.scene_id)


@dataclass(frozen=True, eq=False)
class CriticalityTable:
    """All drivers of a corpus, and what was counted: collisions by how they came about, pairs that began overlapped."""

    drivers: DriverCriticality
    counts: Counter[str]


def drivers_criticality(corpus: Corpus, *, progress: Callable[[int, int], None] | None = None) -> CriticalityTable:
    """One pass over the corpus, one scene in memory at a time; rows in order of scene and agent.

    Speeds are the shared smoother's; the leader is the one along the lane, else straight ahead (`labelers.lanes`).
    """
    parts: list[DriverCriticality] = []
    counts: Counter[str] = Counter()
    for done, scene in enumerate(corpus, start=1):
        parts.append(_of_scene(scene, counts))
        if progress is not None:
            progress(done, len(corpus))
    joined: dict[str, Any] = {
        f.name: (
            np.concatenate([getattr(p, f.name) for p in parts])
            if isinstance(getattr(parts[0], f.name), np.ndarray)
            else tuple(value for p in parts for value in getattr(p, f.name))
        )
        for f in fields(DriverCriticality)
    }
    return CriticalityTable(DriverCriticality(**joined), counts)


def _of_scene(scene: Scene, counts: Counter[str]) -> DriverCriticality:
    tracks = scene.tracks
    chosen = np.flatnonzero(tracks.is_motor & tracks.valid.any(axis=1))
    follow = following(scene)
    ttc = time_to_collision(follow.gap_m, follow.speed_mps, follow.leader_speed_mps)
    headway = np.where(follow.speed_mps >= MOVING_MPS, time_headway_s(follow.gap_m, follow.speed_mps), np.nan)
    needed = required_deceleration_mps2(follow.gap_m, follow.speed_mps, follow.leader_speed_mps)
    pet, pet_conflicts = _encroached(scene)
    charged, involved = _collided(scene, counts)
    step = np.hypot(*np.moveaxis(np.diff(tracks.position_m.astype(np.float64), axis=1), -1, 0))
    names = tuple("" if d is None else d.name for d in tracks.driver)
    return DriverCriticality(
        scene_id=(scene.scene_id,) * len(chosen),
        agent_id=tuple(tracks.agent_id[i] for i in chosen),
        unit=(scene.unit_id,) * len(chosen),
        source=(scene.source,) * len(chosen),
        scenario=(scene.scenario,) * len(chosen),
        style=tuple(names[i] or NOBODY for i in chosen),
        km=np.nansum(step, axis=1)[chosen] / 1000.0,
        hours=tracks.valid.sum(axis=1)[chosen] * tracks.dt_s / 3600.0,
        ttc_min_s=_least(ttc)[chosen],
        ttc_p5_s=_inner(ttc)[chosen],
        headway_min_s=_least(headway)[chosen],
        headway_p5_s=_inner(headway)[chosen],
        deceleration_max_mps2=-_least(-np.where(np.isposinf(needed), np.nan, needed))[chosen],
        pet_min_s=pet[chosen],
        ttc_conflicts=_encounters(ttc < CRITICAL_TTC_S, follow.leader)[chosen],
        deceleration_conflicts=_encounters(needed > CRITICAL_DECELERATION_MPS2, follow.leader)[chosen],
        pet_conflicts=pet_conflicts[chosen],
        collisions_charged=charged[chosen],
        in_collisions=involved[chosen],
    )


def _least(value: Float64[np.ndarray, "agent time"]) -> Float64[np.ndarray, " agent"]:
    """Least finite value of each agent; NaN without one."""
    known = np.where(np.isfinite(value), value, np.inf).min(axis=1)
    return np.where(np.isfinite(known), known, np.nan)


def _inner(value: Float64[np.ndarray, "agent time"]) -> Float64[np.ndarray, " agent"]:
    """5 % point of each agent's finite values; NaN without one."""
    result = np.full(len(value), np.nan)
    for agent, row in enumerate(value):
        known = row[np.isfinite(row)]
        if len(known):
            result[agent] = np.percentile(known, INNER)
    return result


def _encounters(
    critical: Bool[np.ndarray, "agent time"], leader: Int64[np.ndarray, "agent time"]
) -> Int64[np.ndarray, " agent"]:
    """In how many unbroken stretches behind one leader it was critical at least once."""
    begins = np.diff(leader, axis=1, prepend=-2) != 0
    stretch = np.cumsum(begins, axis=1)
    result = np.zeros(len(leader), np.int64)
    agent, frame = np.nonzero(critical & (leader >= 0))
    for one in np.unique(agent):
        result[one] = len(np.unique(stretch[one, frame[agent == one]]))
    return result


def _encroached(scene: Scene) -> tuple[Float64[np.ndarray, " agent"], Int64[np.ndarray, " agent"]]:
    """Least post-encroachment time of each agent with anybody on a crossing way, and how many were critical."""
    tracks = scene.tracks
    sized = np.isfinite(tracks.size_m).all(axis=1)
    present = tracks.valid & sized[:, None]
    found = encroachments(tracks.position_m, tracks.heading_rad, tracks.size_m, present, dt_s=tracks.dt_s)
    least, critical = np.full(tracks.n_agents, np.inf), np.zeros(tracks.n_agents, np.int64)
    for who in (found.first, found.second):
        np.minimum.at(least, who, found.pet_s)
        np.add.at(critical, who[found.pet_s < CRITICAL_PET_S], 1)
    return np.where(np.isfinite(least), least, np.nan), critical


def _collided(scene: Scene, counts: Counter[str]) -> tuple[Int64[np.ndarray, " agent"], Int64[np.ndarray, " agent"]]:
    """Collisions that each agent is charged with, and all that it was in; how they came about goes into `counts`."""
    charged, involved = np.zeros(scene.tracks.n_agents, np.int64), np.zeros(scene.tracks.n_agents, np.int64)
    found, at_first_sight = collisions_of(scene)
    counts["overlapped when first seen"] += at_first_sight
    for one in found:
        counts[f"collision: {one.how}"] += 1
        if one.under_stressor:
            counts["collision under a stressor, charged to nobody"] += 1
        else:
            charged[list(one.charged)] += 1
        involved[[one.first, one.second]] += 1
    return charged, involved
