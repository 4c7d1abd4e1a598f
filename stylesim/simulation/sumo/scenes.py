"""Makes a `Scene` of an episode's log."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int32, Int64

from stylesim.overlaps import overlaps
from stylesim.scene import Scene
from stylesim.signals import Signals
from stylesim.simulation.sumo.bodies import Bodies, bodies_of
from stylesim.simulation.sumo.episode import DT_S, Episode
from stylesim.simulation.sumo.events import flags_of
from stylesim.simulation.sumo.recorder import RawLog
from stylesim.simulation.sumo.signals import signal_log
from stylesim.simulation.sumo.yellow import DecisionEvent
from stylesim.tracks import TrackFlag, Tracks

SETTLING_S = 3.0  # after insertion, not logged: SUMO's vehicles find their speed and lane in that time


def scene_of(
    log: RawLog, decisions: list[DecisionEvent], files: Episode, *, name: str, bodies: Bodies | None = None
) -> Scene:
    """The scene of the frames after the warm-up; the first 3 s after each vehicle's insertion are not logged.

    `bodies` are those of the log, where several scenes are cut from it and they were made before.
    """
    warm, frames = round(files.warm_up_s / DT_S), round(files.duration_s / DT_S)
    signals = _signals(log, files, start=warm, frames=frames)
    bodies = bodies_of(log, files) if bodies is None else bodies
    tracks, counts = _tracks(bodies, log, decisions, files, signals, warm=warm, frames=frames)
    counts["drivers"] = len(files.drivers)
    counts["not_inserted"] = len(files.drivers) - len(log.driver_ids)
    scene_id = f"{name}-{files.seed}-{files.episode:05d}"
    return Scene(
        scene_id=scene_id,
        unit_id=scene_id,
        source="sumo",
        scenario=name,
        tracks=tracks,
        road=files.network.road,
        signals=signals,
        source_scenario_id=scene_id,
        counts=counts,
        parameters=files.parameters,
    )


def _signals(log: RawLog, files: Episode, *, start: int, frames: int) -> Signals | None:
    shown = {name: (log.texts, log.shown[start : start + frames]) for name, log in log.signals.items()}
    return signal_log(files.network, shown)


def _tracks(
    bodies: Bodies,
    log: RawLog,
    decisions: list[DecisionEvent],
    files: Episode,
    signals: Signals | None,
    *,
    warm: int,
    frames: int,
) -> tuple[Tracks, dict[str, int]]:
    """The tracks of the drivers with a logged frame, and what is counted of them."""
    settled = bodies.step - log.depart_step[bodies.driver] >= round(SETTLING_S / DT_S)
    in_time = (bodies.step >= warm) & (bodies.step < warm + frames)
    logged = settled & in_time & ~bodies.segments.is_first()
    lanes = {lane.lane_id: lane for lane in files.network.road.lanes}
    flags = flags_of(bodies, log, logged=logged, first_step=warm, signals=signals, lanes=lanes, decisions=decisions)
    keep = np.flatnonzero(np.bincount(bodies.driver[logged], minlength=len(log.driver_ids)))
    tracks = _dense(bodies, files, log.driver_ids, flags, logged=logged, keep=keep, warm=warm, frames=frames)
    counts = _counts(tracks, log, range(warm, warm + frames))
    answered = [event for event in decisions if warm <= event.step < warm + frames]
    counts["stop_impossible"] = sum(event.impossible for event in answered)
    counts["gave_up_at_red"] = sum(event.gave_up for event in answered)
    counts["missed_turns"] = sum(warm <= step < warm + frames for step, _ in log.missed_turns)
    counts["settling_steps_dropped"] = int((in_time & ~logged).sum())
    return tracks, counts | _overlap_counts(bodies, files, log.driver_ids, logged)


def _dense(
    bodies: Bodies,
    files: Episode,
    driver_ids: tuple[str, ...],
    flags: Int32[np.ndarray, " driver"],
    *,
    logged: Bool[np.ndarray, " row"],
    keep: Int64[np.ndarray, " agent"],
    warm: int,
    frames: int,
) -> Tracks:
    drivers = [files.now[driver_ids[index]] for index in keep]
    place = np.full(len(driver_ids), -1)
    place[keep] = np.arange(len(keep))
    at = (place[bodies.driver[logged]], bodies.step[logged] - warm)
    position = np.full((len(keep), frames, 2), np.nan, np.float32)
    velocity = np.full((len(keep), frames, 2), np.nan, np.float32)
    heading = np.full((len(keep), frames), np.nan, np.float32)
    valid = np.zeros((len(keep), frames), bool)
    position[at], velocity[at] = bodies.position_m[logged], bodies.velocity_mps[logged]
    heading[at], valid[at] = bodies.heading_rad[logged], True
    return Tracks(
        agent_id=tuple(driver.driver_id for driver in drivers),
        kind=np.array([driver.kind for driver in drivers], np.int8),
        size_m=np.array([[driver.length_m, driver.width_m] for driver in drivers], np.float32).reshape(-1, 2),
        position_m=position,
        velocity_mps=velocity,
        heading_rad=heading,
        valid=valid,
        dt_s=DT_S,
        driver=tuple(driver.style for driver in drivers),
        flags=flags[keep],
    )


def _counts(tracks: Tracks, log: RawLog, steps: range) -> dict[str, int]:
    """Flags by name (tracks that carry them), and collisions by pair."""
    names = {flag.name.lower(): flag for flag in TrackFlag if flag.name is not None}
    outcomes = ("emergency_braked", "ran_red", "teleported", "removed", "collided")
    answers = ("decided_stop", "decided_go", "stopped_at_line", "crossed_on_yellow")
    counts = {name: int(tracks.flagged(names[name]).sum()) for name in outcomes + answers}
    counts["collisions"] = len({tuple(sorted(pair)) for step, *pair in log.collisions if step in steps})
    return counts


def _overlap_counts(
    bodies: Bodies, files: Episode, driver_ids: tuple[str, ...], logged: Bool[np.ndarray, " row"]
) -> dict[str, int]:
    """Pairs of drivers whose logged boxes overlap at least once, and in how many frames."""
    size = np.array([[files.drivers[name].length_m, files.drivers[name].width_m] for name in driver_ids]).reshape(-1, 2)
    who = bodies.driver[logged]
    found = overlaps(bodies.step[logged], who, bodies.position_m[logged], bodies.heading_rad[logged], size[who])
    pairs = {(min(a, b), max(a, b)) for _, a, b in found.tolist()}
    return {"overlaps": len(pairs), "overlap_frames": len(found)}
