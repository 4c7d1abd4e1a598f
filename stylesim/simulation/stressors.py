"""Unusual events in an episode, whatever the simulator: what is drawn for them, what they leave in the scene.

docs/stressors.md says what each does, with the sources of the numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stylesim.errors import InputError
from stylesim.randomness import stream
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.simulation.plan import EpisodePlan, StressorKind
from stylesim.simulation.walkers import Walker, with_walkers
from stylesim.tracks import TrackFlag

# Shares of the log between which an event may begin; chosen, so that it is seen to its end.
EARLIEST, LATEST = 0.15, 0.6
LAST_CHANCE = 0.8  # a moment that finds nobody is tried again until then


@dataclass(frozen=True)
class Attempt:
    """One stressor of one episode: from `at_s` of the log on it happens as soon as somebody fits."""

    kind: StressorKind
    at_s: float
    until_s: float
    numbers: Mapping[str, float]
    rng: np.random.Generator = field(repr=False)  # for the choice among those who fit


def _numbers(kind: StressorKind, rng: np.random.Generator) -> dict[str, float]:
    """What is drawn of one event; the sources are in docs/stressors.md."""
    if kind == "hard_brake":
        return {"braking_mps2": float(rng.uniform(5.0, 7.5)), "to_share": float(rng.uniform(0.0, 0.4)), "hold_s": 1.5}
    if kind == "stalled":
        return {"braking_mps2": float(rng.uniform(2.0, 3.0)), "hold_s": float(rng.uniform(15.0, 30.0))}
    if kind == "cut_in":
        return {"gap_s": float(rng.uniform(0.4, 1.0)), "duration_s": float(rng.uniform(2.0, 3.0))}
    if kind == "red_runner":
        return {}
    if kind == "jaywalker":
        speed = float(np.clip(rng.normal(1.6, 0.3), 1.0, 2.5))
        needed = float(rng.uniform(2.5, 5.0))
    else:
        speed, needed = float(rng.uniform(4.0, 9.0)), float(rng.uniform(3.0, 6.0))
    return {
        "speed_mps": speed,
        "needed_mps2": needed,
        "before_s": float(rng.uniform(0.2, 1.0)),
        "side": float(rng.random()),
    }


def attempts(plan: EpisodePlan, *, seed: int, episode: int, duration_s: float) -> tuple[Attempt, ...]:
    """The stressors that this episode gets; each has a random stream of its own."""
    found = []
    for stressor in plan.stressors:
        rng = stream(seed, episode, "", f"stressor {stressor.kind}")
        if rng.random() >= stressor.share:
            continue
        at_s = float(rng.uniform(EARLIEST, LATEST)) * duration_s
        found.append(Attempt(stressor.kind, at_s, LAST_CHANCE * duration_s, _numbers(stressor.kind, rng), rng))
    return tuple(found)


def check_possible(plan: EpisodePlan, road: Road, name: str) -> None:
    """InputError for a stressor that this road can never show."""
    kinds = {stressor.kind for stressor in plan.stressors}
    if "red_runner" in kinds and not any(lane.in_junction for lane in road.lanes):
        raise InputError(
            f"stressor 'red_runner': scenario {name!r} has no crossing; choose one with a signal or junction"
        )
    if "cut_in" in kinds and not any(lane.left_neighbour or lane.right_neighbour for lane in road.lanes):
        raise InputError(
            f"stressor 'cut_in': scenario {name!r} has one lane per direction; choose one with two or more"
        )


@dataclass(frozen=True)
class Event:
    """What happened: who did it (`actor`, a driver or a walker), to whom (`victim`, "" for nobody in particular)."""

    kind: StressorKind
    time_s: float  # of the log
    actor: str
    victim: str
    numbers: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """The JSON form, for `Scene.metadata["events"]`."""
        rounded = {name: round(value, 4) for name, value in sorted(self.numbers.items())}
        return {
            "kind": self.kind,
            "time_s": round(self.time_s, 3),
            "actor": self.actor,
            "victim": self.victim,
            **rounded,
        }


@dataclass(frozen=True)
class Outcome:
    """What the stressors of one episode came to."""

    events: tuple[Event, ...] = ()
    walkers: tuple[Walker, ...] = ()
    missed: tuple[StressorKind, ...] = ()  # nobody fitted at their moment


def with_events(scene: Scene, outcome: Outcome, plan: EpisodePlan) -> Scene:
    """The scene with the walkers among its tracks, actors and victims flagged, events in its metadata, all counted."""
    if not plan.stressors:
        return scene
    tracks, counts = scene.tracks, dict(scene.counts)
    walkers = [w for w in outcome.walkers if w.begin_s < (tracks.n_frames - 1) * tracks.dt_s]
    if walkers:
        tracks, hit = with_walkers(tracks, walkers)
        counts["collisions"] = counts.get("collisions", 0) + hit
        counts["collided"] = int(tracks.flagged(TrackFlag.COLLIDED).sum())
        counts["walkers"], counts["walkers_hit"] = len(walkers), hit
    number = {name: index for index, name in enumerate(tracks.agent_id)}
    flags = np.array(tracks.flags)
    for event in outcome.events:
        for name, flag in ((event.actor, TrackFlag.STRESSOR), (event.victim, TrackFlag.STRESSED)):
            if name in number:
                flags[number[name]] |= int(flag)
    for stressor in plan.stressors:
        counts[f"stressor.{stressor.kind}"] = sum(event.kind == stressor.kind for event in outcome.events)
        counts[f"stressor.{stressor.kind}.nobody_fitted"] = sum(kind == stressor.kind for kind in outcome.missed)
    events = [event.to_dict() for event in sorted(outcome.events, key=lambda event: (event.time_s, event.kind))]
    return replace(
        scene, tracks=replace(tracks, flags=flags), counts=counts, metadata={**scene.metadata, "events": events}
    )
