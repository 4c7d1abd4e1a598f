"""What simulated drivers did at the onset of yellow: time to the stop line, commanded style, stop or go."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.corpus import Corpus
from stylesim.geometry import project
from stylesim.road import Lane
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import TrackFlag

LANE_REACH_M = 2.5  # chosen: half a lane and some wander; farther out it is on another lane
MAX_TTS_S = 10.0  # chosen: beyond it nobody decides yet (REFERENCE section 5: all have stopped by 5.5 s)
MIN_SPEED_MPS = 2.0  # chosen: a car that crawls at the onset has no meaningful time to the stop line


@dataclass(frozen=True, eq=False)
class YellowDecisions:
    """One row per decision. `counts` says how many flagged drivers could not be placed, and why."""

    tts_s: Float64[np.ndarray, " decision"]
    stopped: Bool[np.ndarray, " decision"]
    style: tuple[str, ...]
    unit: tuple[str, ...]
    counts: dict[str, int]

    def __len__(self) -> int:
        """Number of decisions."""
        return len(self.style)


def _metres_to_line(scene: Scene, agent: int, frame: int, lane: Lane) -> float | None:
    """From the front bumper to the lane's stop line; None where it is not on that lane, or past the line."""
    tracks = scene.tracks
    if lane.stop_line_m is None:
        return None
    along, _, distance, _ = project(tracks.position_m[agent, frame][None], lane.centre_line_m)
    line_at, _, _, _ = project(lane.stop_line_m.mean(axis=0)[None], lane.centre_line_m)
    ahead = float(line_at[0] - along[0]) - float(np.nan_to_num(tracks.size_m[agent, 0])) / 2
    return ahead if distance[0] <= LANE_REACH_M and ahead > 0 else None


def _onsets(scene: Scene) -> list[tuple[int, tuple[str, ...]]]:
    """(frame, lanes) of every change to yellow."""
    assert scene.signals is not None
    state = scene.signals.state
    changed = (state[:, 1:] == SignalState.YELLOW) & (state[:, :-1] != SignalState.YELLOW)
    return [(int(frame) + 1, scene.signals.lane_id[light]) for light, frame in np.argwhere(changed)]


def _decision(scene: Scene, agent: int, lanes: dict[str, Lane], counts: Counter[str]) -> float | None:
    """The time to the stop line at the onset at which this driver was nearest to it; None, counted, without one."""
    speed = scene.tracks.speed_mps[agent]
    seen = [
        (ahead, float(speed[frame]))
        for frame, ids in _onsets(scene)
        if scene.tracks.valid[agent, frame]
        for lane_id in ids
        if lane_id in lanes and (ahead := _metres_to_line(scene, agent, frame, lanes[lane_id])) is not None
    ]
    moving = [ahead / v for ahead, v in seen if v >= MIN_SPEED_MPS]
    if moving and min(moving) <= MAX_TTS_S:
        return min(moving)
    slow = f"slower than {MIN_SPEED_MPS:g} m/s at the onset"
    far = f"more than {MAX_TTS_S:g} s from the line"
    counts[far if moving else slow if seen else "not on a controlled lane at the onset"] += 1
    return None


def yellow_decisions(corpus: Corpus) -> YellowDecisions | None:
    """Every commanded driver that carries a decision flag, placed by geometry; None where nobody does.

    The lane is the controlled lane whose centre line the driver is on at the onset; a driver who is still on the lane
    before it, or who passed several yellows (then the nearest counts), is a limit of this reading and is counted.
    """
    rows: list[tuple[float, bool, str, str]] = []
    counts: Counter[str] = Counter()
    for scene in corpus:
        stop, go = scene.tracks.flagged(TrackFlag.DECIDED_STOP), scene.tracks.flagged(TrackFlag.DECIDED_GO)
        deciders = np.flatnonzero(stop | go).tolist()
        counts["decided"] += len(deciders)
        if scene.signals is None or scene.road is None:
            counts["no road or no lights"] += len(deciders)
            continue
        lanes = {lane.lane_id: lane for lane in scene.road.lanes}
        for agent in deciders:
            driver = scene.tracks.driver[agent]
            if stop[agent] and go[agent]:
                counts["decided both ways"] += 1
            elif driver is None:
                counts["not commanded"] += 1
            elif (time := _decision(scene, agent, lanes, counts)) is not None:
                rows.append((time, bool(stop[agent]), driver.name, scene.unit_id))
    if not rows:
        return None
    tts, stopped, style, unit = zip(*rows, strict=True)
    return YellowDecisions(np.array(tts, np.float64), np.array(stopped, bool), style, unit, dict(counts))
