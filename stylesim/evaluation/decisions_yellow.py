"""Stop or go at the yellow: every driver for whom both were possible at the onset, and what it did."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from stylesim.evaluation.approaches import LANE_REACH_M, MIN_SPEED_MPS, onsets, places
from stylesim.evaluation.decisions import STOP_OR_GO, Decision
from stylesim.geometry import project
from stylesim.road import Lane
from stylesim.scene import Scene

# REFERENCE section 5: P(stop) is 9 % at 1.6 s and 100 % at 5.5 s to the line (Rakha et al. 2007).
LEAST_TTS_S, MOST_TTS_S = 1.6, 5.5
ROOM_S = 1.0  # chosen: who goes on at its speed is over the line so long before the horizon


def yellow_decisions_of(scene: Scene, steps: int, counts: Counter[str]) -> Iterator[Decision]:
    """Decisions at the onsets of yellow of a scene; t0 is the first frame that shows it.

    Gone is who has its front over the line within `steps` frames. Who is behind another that has not gone had no
    choice, and is counted; so is who would not be over the line within the future at its speed.
    """
    tracks, speed = scene.tracks, scene.tracks.speed_mps
    half = np.nan_to_num(tracks.size_m[:, 0].astype(np.float64)) / 2
    most = min(MOST_TTS_S, steps * tracks.dt_s - ROOM_S)
    for frame, lights in onsets(scene).items():
        here = np.flatnonzero(tracks.valid[:, frame] & tracks.is_motor)
        if not lights or not len(here) or frame + steps >= tracks.n_frames:
            continue
        ahead, away, line_at = places(tracks.position_m[here, frame], half[here], [lane for _, lane in lights])
        nearest = np.argmin(away, axis=0)
        for row, (_, lane) in enumerate(lights):
            on = np.flatnonzero((nearest == row) & (away[row] <= LANE_REACH_M) & (ahead[row] > 0))
            blocked = False
            for place in on[np.argsort(ahead[row, on], kind="stable")].tolist():
                agent = int(here[place])
                station = line_at[row] - half[agent]
                went = _passed(scene, agent, frame, steps, lane, station)
                if went is None:
                    counts["at the yellow: track ends within the future"] += 1
                    blocked = True  # nobody knows what it did before those behind it
                    continue
                pace = float(speed[agent, frame])
                if blocked:
                    counts["at the yellow: behind one who stopped"] += 1
                elif pace < MIN_SPEED_MPS or not LEAST_TTS_S <= ahead[row, place] / pace <= most:
                    counts["at the yellow: too near, too far or too slow to decide"] += 1
                else:
                    line = lane.centre_line_m.astype(np.float64)
                    yield Decision(STOP_OR_GO, agent, frame, line, station, steps, went)
                blocked |= not went


def _passed(scene: Scene, agent: int, frame: int, steps: int, lane: Lane, station_m: float) -> bool | None:
    """Whether its centre came to `station_m` along the lane; None where its track ends without that."""
    ahead = slice(frame, frame + 1 + steps)
    known = scene.tracks.valid[agent, ahead]
    along = project(scene.tracks.position_m[agent, ahead][known], lane.centre_line_m)[0]
    if along.max() >= station_m:
        return True
    return False if known.all() else None
