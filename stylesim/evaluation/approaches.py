"""What drivers did at the onset of yellow, read from their tracks: stopped before the line, or crossed; and how."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int, Int64

from stylesim.geometry import project
from stylesim.road import Lane
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import TrackFlag, Tracks

LANE_REACH_M = 2.5  # chosen: half a lane and some wander; farther out it is on another lane
MIN_SPEED_MPS = 2.0  # chosen: a car that crawls at the onset has no meaningful time to the stop line
MAX_TTS_S = 10.0  # chosen: beyond it nobody decides yet (REFERENCE section 5: all have stopped by 5.5 s)
STANDING_MPS = 0.3  # who is slower has stopped; as in the flag STOPPED_AT_LINE
FREE_M = 100.0  # REFERENCE section 5: the neutral driver has no leader within 100 m
SPEED_LOST_MPS = 0.5  # chosen: braking has begun when so much speed is lost for good; pedal noise moves it by less


@dataclass(frozen=True, eq=False)
class Approaches:
    """One row per driver and onset of yellow on its lane. `counts` says who is not among them, and why."""

    style: tuple[str, ...]  # the commanded class
    unit: tuple[str, ...]
    tts_s: Float64[np.ndarray, " row"]  # time to the stop line at the onset, at the speed at the onset
    speed_mps: Float64[np.ndarray, " row"]
    free: Bool[np.ndarray, " row"]  # nobody within 100 m ahead on its lane
    decided: Int64[np.ndarray, " row"]  # 1 to stop, 0 to go, -1 not known (none, or different ones at several lights)
    stopped: Bool[np.ndarray, " row"]  # before the line; False: crossed it
    ran_red: Bool[np.ndarray, " row"]  # front over the line 0.1 s after the onset of red or later
    response_s: Float64[np.ndarray, " row"]  # from the onset to braking; NaN for who crossed
    deceleration_mps2: Float64[np.ndarray, " row"]  # v^2 / 2d from there to standing; NaN for who crossed
    counts: dict[str, int]

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.style)

    def where(self, keep: Bool[np.ndarray, " row"]) -> Approaches:
        """The rows to keep."""
        rows = np.flatnonzero(keep).tolist()
        return Approaches(
            style=tuple(self.style[row] for row in rows),
            unit=tuple(self.unit[row] for row in rows),
            tts_s=self.tts_s[keep],
            speed_mps=self.speed_mps[keep],
            free=self.free[keep],
            decided=self.decided[keep],
            stopped=self.stopped[keep],
            ran_red=self.ran_red[keep],
            response_s=self.response_s[keep],
            deceleration_mps2=self.deceleration_mps2[keep],
            counts=self.counts,
        )


@dataclass(frozen=True)
class _Outcome:
    stopped: bool
    ran_red: bool
    response_s: float
    deceleration_mps2: float


def yellow_approaches(scenes: Iterable[Scene]) -> Approaches:
    """Every commanded driver on a controlled lane at an onset of yellow, less than 10 s from its line.

    Left out and counted: who crawls at the onset, and who neither stands nor crosses before its next green or its
    track's end. Scenes without road or signals have none.
    """
    rows: list[tuple[object, ...]] = []
    counts: Counter[str] = Counter()
    for scene in scenes:
        rows += _of_scene(scene, counts)
    columns: list[tuple[object, ...]] = list(zip(*rows, strict=True)) if rows else [()] * 10
    style, unit, tts, speed, free, decided, stopped, ran_red, response, deceleration = columns
    return Approaches(
        style=tuple(map(str, style)),
        unit=tuple(map(str, unit)),
        tts_s=np.array(tts, np.float64),
        speed_mps=np.array(speed, np.float64),
        free=np.array(free, bool),
        decided=np.array(decided, np.int64),
        stopped=np.array(stopped, bool),
        ran_red=np.array(ran_red, bool),
        response_s=np.array(response, np.float64),
        deceleration_mps2=np.array(deceleration, np.float64),
        counts=dict(counts),
    )


def onsets(scene: Scene) -> dict[int, list[tuple[int, Lane]]]:
    """By frame, the (light, lane) that turn from green to yellow in it, for lanes that have a stop line."""
    found: dict[int, list[tuple[int, Lane]]] = defaultdict(list)
    if scene.signals is None or scene.road is None:
        return found
    lanes = {lane.lane_id: lane for lane in scene.road.lanes if lane.stop_line_m is not None}
    state = scene.signals.state
    changed = (state[:, 1:] == SignalState.YELLOW) & (state[:, :-1] == SignalState.GREEN)
    for light, frame in np.argwhere(changed).tolist():
        found[frame + 1] += [(light, lanes[name]) for name in scene.signals.lane_id[light] if name in lanes]
    return found


def _of_scene(scene: Scene, counts: Counter[str]) -> Iterator[tuple[object, ...]]:
    tracks, speed = scene.tracks, scene.tracks.speed_mps
    half = np.nan_to_num(tracks.size_m[:, 0].astype(np.float64)) / 2
    stop, go = tracks.flagged(TrackFlag.DECIDED_STOP), tracks.flagged(TrackFlag.DECIDED_GO)
    decided = np.where(stop != go, np.where(stop, 1, 0), -1)
    for frame, lights in onsets(scene).items():
        assert scene.signals is not None
        here = np.flatnonzero(tracks.valid[:, frame])
        if not (len(here) and lights):  # nobody, or no light whose lane has a stop line
            continue
        ahead, away, line_at = places(tracks.position_m[here, frame], half[here], [lane for _, lane in lights])
        nearest = np.argmin(away, axis=0)
        for row, (light, lane) in enumerate(lights):
            on = (nearest == row) & (away[row] <= LANE_REACH_M) & (ahead[row] > 0)
            shown = scene.signals.state[light]
            green = np.flatnonzero(shown[frame:] == SignalState.GREEN)
            frames = slice(frame, frame + int(green[0]) if len(green) else len(shown))
            for place in np.flatnonzero(on).tolist():
                agent, metres = int(here[place]), float(ahead[row, place])
                driver, pace = tracks.driver[agent], float(speed[agent, frame])
                if driver is None or metres > MAX_TTS_S * max(pace, MIN_SPEED_MPS):
                    continue
                counts["at the onset of yellow"] += 1
                if pace < MIN_SPEED_MPS:
                    counts[f"slower than {MIN_SPEED_MPS:g} m/s at the onset"] += 1
                    continue
                centre_at = line_at[row] - half[agent]
                found = _outcome(tracks, speed[agent], agent, frames, lane, centre_at, shown)
                if found is None:
                    counts["neither stood nor crossed before the next green"] += 1
                    continue
                free = not (on & (ahead[row] < metres) & (ahead[row] > metres - FREE_M)).any()
                start = (driver.name, scene.unit_id, metres / pace, pace, free, decided[agent])
                yield (*start, found.stopped, found.ran_red, found.response_s, found.deceleration_mps2)


def places(
    points_m: Float[np.ndarray, "agent 2"], half_m: Float64[np.ndarray, " agent"], lanes: Sequence[Lane]
) -> tuple[Float64[np.ndarray, "lane agent"], Float64[np.ndarray, "lane agent"], list[float]]:
    """From each front to each lane's stop line, from each centre to the lane, and where on the lane the line is."""
    ahead, away, line_at = [], [], []
    for lane in lanes:
        assert lane.stop_line_m is not None
        along, _, distance, _ = project(points_m, lane.centre_line_m)
        line_at.append(float(project(lane.stop_line_m.mean(axis=0)[None], lane.centre_line_m)[0][0]))
        ahead.append(line_at[-1] - along - half_m)
        away.append(distance)
    return np.array(ahead), np.array(away), line_at


def _outcome(
    tracks: Tracks,
    pace_mps: Float[np.ndarray, " time"],
    agent: int,
    frames: slice,
    lane: Lane,
    centre_at_m: float,
    shown: Int[np.ndarray, " time"],
) -> _Outcome | None:
    """What came first in `frames`: standing, or the front over the line (the centre over `centre_at_m`)."""
    frame, valid = frames.start, tracks.valid[agent, frames]
    last = frame + (int(np.argmin(valid)) if not valid.all() else len(valid))
    speed = pace_mps[frame:last].astype(np.float64)
    along = project(tracks.position_m[agent, frame:last], lane.centre_line_m)[0]
    over, stands = np.flatnonzero(along >= centre_at_m), np.flatnonzero(speed < STANDING_MPS)
    if len(over) and not (len(stands) and stands[0] < over[0]):
        at = frame + int(over[0])
        ran_red = bool(shown[at] == SignalState.RED and shown[at - 1] == SignalState.RED)
        return _Outcome(stopped=False, ran_red=ran_red, response_s=np.nan, deceleration_mps2=np.nan)
    if not len(stands):
        return None
    rest = int(stands[0])
    begin = int(np.flatnonzero(speed[: rest + 1] >= speed[0] - SPEED_LOST_MPS)[-1])
    metres = max(float(along[rest] - along[begin]), 1e-3)
    return _Outcome(
        stopped=True,
        ran_red=False,
        response_s=begin * tracks.dt_s,
        deceleration_mps2=float(speed[begin] ** 2 / (2 * metres)),
    )
