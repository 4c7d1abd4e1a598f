"""Long recordings cut into scenes of fixed length."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.datasets.accounting import added, row_counts
from stylesim.datasets.flagging import flagged_implausible
from stylesim.datasets.recording import Recording
from stylesim.errors import InputError
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.signals import Signals
from stylesim.tracks import Tracks

# Chosen, because four windows of 5 s + 6 s that begin 3 s apart fill it with nothing left over, and because the
# guard gap between time blocks of a split (>= 11 s) then costs one scene, not half a minute.
SCENE_S = 20.0


def cut(
    recording: Recording,
    *,
    source: str,
    scenario: str,
    unit_id: str,
    origin_m: Float64[np.ndarray, " 2"],
    road: Road | None = None,
    scene_s: float = SCENE_S,
    unit_start_s: float = 0.0,
) -> Iterator[Scene]:
    """The scenes of one recording, in time; `road` is in metres from `origin_m`.

    Scene k holds the frames [k, k + 1) * scene_s of the recording's clock; a road user seen in several scenes
    keeps its id; the last scene is as long as what is left; stretches without any road user give no scene.
    Nothing that happens later decides what is in a scene, so a file cut off at t0 gives the same history.
    The rows that the recording dropped are counted in its first scene.
    """
    length = round(scene_s / recording.dt_s)
    if length < 2:
        raise InputError(f"scene_s must hold at least two frames of {recording.dt_s} s, not {scene_s} s")
    number = recording.frame // length
    last_frame = int(recording.frame.max(initial=-1))
    extra = {**row_counts(rows_out=0, dropped=recording.dropped), **recording.notes}
    for k in np.unique(number).tolist():
        rows = number == k
        first = k * length
        n_frames = min(length, last_frame + 1 - first)
        yield Scene(
            scene_id=f"{recording.recording_id}_{k:05d}",
            unit_id=unit_id,
            source=source,
            scenario=scenario,
            tracks=_tracks(recording, rows, first, n_frames, origin_m),
            road=road,
            signals=_signals(recording, first, n_frames),
            start_s=unit_start_s + first * recording.dt_s,
            source_scenario_id=recording.recording_id,
            counts=added(row_counts(rows_out=int(rows.sum())), extra),
        )
        extra = {}


def _tracks(
    recording: Recording, rows: Bool[np.ndarray, " row"], first: int, n_frames: int, origin_m: Float64[np.ndarray, " 2"]
) -> Tracks:
    agents, row_agent = np.unique(recording.agent[rows], return_inverse=True)
    at = (row_agent, recording.frame[rows] - first)
    shape = (len(agents), n_frames)
    position, velocity = np.full((*shape, 2), np.nan, np.float32), np.full((*shape, 2), np.nan, np.float32)
    heading, valid = np.full(shape, np.nan, np.float32), np.zeros(shape, bool)
    ahead = np.zeros(shape, np.int16)
    position[at] = recording.position_m[rows] - origin_m
    velocity[at] = recording.velocity_mps[rows]
    heading[at] = recording.heading_rad[rows]
    ahead[at] = recording.lookahead[rows]
    valid[at] = True
    tracks = Tracks(
        agent_id=tuple(recording.agent_id[i] for i in agents),
        kind=recording.kind[agents],
        size_m=recording.size_m[agents],
        position_m=position,
        velocity_mps=velocity,
        heading_rad=heading,
        valid=valid,
        dt_s=recording.dt_s,
        origin_m=origin_m,
        lookahead_steps=ahead,
    )
    return flagged_implausible(tracks)


def _signals(recording: Recording, first: int, n_frames: int) -> Signals | None:
    log = recording.signals
    if log is None:
        return None
    times = (first + np.arange(n_frames)) * recording.dt_s
    links = log.lane_id or ((),) * len(log.signal_id)
    return Signals(signal_id=log.signal_id, lane_id=links, state=log.at(times))
