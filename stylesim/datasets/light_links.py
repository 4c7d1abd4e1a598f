"""Which light controls which lane, inferred from when vehicles cross the stop line: a guess with its confidence.

For each lane with a stop line, the crossings by motor vehicles are sorted by what each light showed just then. If a
light controls the lane, a crossing falls into its green or yellow with probability 1 - VIOLATION; if not, only as
often as that light is green or yellow anyway. The lane takes the light with the greatest likelihood; the confidence
is that light's share of the likelihood of all lights and of "none of them". Lights that always show the same are one
candidate. A link below MIN_CONFIDENCE stays unknown. It is learnt from the whole recording: a property of the site,
not of one driver, but one that a strict study of forecasting takes from another recording.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.datasets.recording import Recording, SignalLog
from stylesim.geometry import project
from stylesim.road import Lane, Road
from stylesim.signals import SignalState
from stylesim.tracks import MOTOR_KINDS

LINKS = ("map", "infer", "none")
VIOLATION = 0.02  # chosen: of vehicles that cross, so many do it on red or by an error of the clock
MIN_CONFIDENCE = 0.95  # chosen: the usual bound
MIN_CROSSINGS = 8  # chosen: fewer cannot reach the confidence against a light that is green half of the time
LANE_SHARE = 0.5  # of the lane's width to either side, where a vehicle counts as on it
DEFAULT_WIDTH_M = 3.5


@dataclass(frozen=True)
class Link:
    """One lane's light: which, how sure, and from how many crossings."""

    lane_id: str
    signal_id: str
    confidence: float
    crossings: int


def with_stop_lines(road: Road) -> Road:
    """The road with a stop line at the end of each lane that leads into a junction and has none."""
    inside = {lane.lane_id for lane in road.lanes if lane.in_junction}
    lanes = tuple(
        replace(lane, stop_line_m=_end_line(lane))
        if lane.stop_line_m is None and not lane.in_junction and inside & set(lane.successors)
        else lane
        for lane in road.lanes
    )
    return replace(road, lanes=lanes)


def _end_line(lane: Lane) -> Float64[np.ndarray, "2 2"]:
    end = lane.centre_line_m[-1].astype(np.float64)
    ahead = end - lane.centre_line_m[-2].astype(np.float64)
    half = (lane.width_m if np.isfinite(lane.width_m) else DEFAULT_WIDTH_M) / 2
    across = half * np.array([-ahead[1], ahead[0]]) / max(float(np.hypot(*ahead)), 1e-9)
    return np.stack([end + across, end - across])


def linked(recording: Recording, road: Road | None, origin_m: Float64[np.ndarray, " 2"]) -> Recording:
    """The recording with inferred links for the lanes that no light controls yet; counted in its notes.

    `road` is in metres from `origin_m`. Without lights or stop lines the recording comes back as it is.
    """
    log = recording.signals
    if log is None or road is None:
        return recording
    known = log.lane_id or ((),) * len(log.signal_id)
    taken = {lane for lanes in known for lane in lanes}
    open_lanes = [lane for lane in road.lanes if lane.stop_line_m is not None and lane.lane_id not in taken]
    found = infer_links(recording, log, open_lanes, origin_m)
    links = {name: list(lanes) for name, lanes in zip(log.signal_id, known, strict=True)}
    for link in found:
        links[link.signal_id].append(link.lane_id)
    notes = {"light_links_inferred": len(found), "light_links_unknown": len(open_lanes) - len(found)}
    return replace(
        recording,
        signals=replace(log, lane_id=tuple(tuple(links[name]) for name in log.signal_id)),
        notes={**recording.notes, **notes},
    )


def infer_links(
    recording: Recording, log: SignalLog, lanes: list[Lane], origin_m: Float64[np.ndarray, " 2"]
) -> list[Link]:
    """The links that are sure enough, lane by lane."""
    go = np.isin(log.state, [int(SignalState.GREEN), int(SignalState.YELLOW)])
    end = float(recording.frame.max(initial=0)) * recording.dt_s
    share = _share(go, log.time_s, end)
    candidate = (share > 0.02) & (share < 0.98)  # chosen: a light that hardly changes says nothing about a lane
    yellow = (log.state == SignalState.YELLOW).any(axis=1)
    if yellow.any():  # lights without yellow are then those of people
        candidate &= yellow
    found = []
    for lane in lanes:
        times = crossing_times(recording, lane, origin_m)
        times = times[(times >= log.time_s[0]) & (times <= log.time_s[-1] + log.stale_s)]
        if len(times) < MIN_CROSSINGS or not candidate.any():
            continue
        shown = np.isin(log.at(times), [int(SignalState.GREEN), int(SignalState.YELLOW)])
        went = shown.sum(axis=1)
        n = len(times)
        # Likelihood ratio of "this light controls it" to "the light has nothing to do with it".
        with np.errstate(divide="ignore", invalid="ignore"):
            odds = went * np.log((1 - VIOLATION) / share) + (n - went) * np.log(VIOLATION / (1 - share))
        odds = np.where(candidate, odds, -np.inf)
        groups = _alike(log.state)
        best = int(odds.argmax())
        top = float(odds.max())
        distinct = [float(odds[np.flatnonzero(groups == g)[0]]) for g in np.unique(groups[candidate])]
        total = np.exp(-top) + sum(np.exp(value - top) for value in distinct)
        confidence = float(1 / total)
        if confidence >= MIN_CONFIDENCE and top > 0:
            found.append(Link(lane.lane_id, log.signal_id[best], confidence, n))
    return found


def crossing_times(recording: Recording, lane: Lane, origin_m: Float64[np.ndarray, " 2"]) -> Float64[np.ndarray, " n"]:
    """When the front of each motor vehicle on that lane passed its stop line (s on the recording's clock)."""
    assert lane.stop_line_m is not None
    line = lane.centre_line_m.astype(np.float64)
    stop = float(project(lane.stop_line_m.astype(np.float64).mean(axis=0)[None], line)[0][0])
    motor = np.isin(recording.kind, [int(k) for k in MOTOR_KINDS])[recording.agent]
    place = recording.position_m - origin_m
    low, high = line.min(axis=0) - 10.0, line.max(axis=0) + 10.0
    near = motor & ((place >= low) & (place <= high)).all(axis=1)
    rows = np.flatnonzero(near)
    if not len(rows):
        return np.zeros(0)
    front = recording.size_m[recording.agent[rows], 0] / 2
    heading = recording.heading_rad[rows]
    nose = place[rows] + front[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    along, offset, distance, segment = project(nose, line)
    step = np.diff(line, axis=0)[segment]
    aligned = np.cos(heading - np.arctan2(step[:, 1], step[:, 0])) > np.cos(np.deg2rad(45.0))
    width = lane.width_m if np.isfinite(lane.width_m) else DEFAULT_WIDTH_M
    inside = aligned & (np.abs(offset) <= LANE_SHARE * width) & (distance <= np.abs(offset) + 10.0)
    return _passed(recording, rows[inside], along[inside], stop)


def _passed(
    recording: Recording, rows: np.ndarray, along_m: Float64[np.ndarray, " row"], stop_m: float
) -> Float64[np.ndarray, " n"]:
    """Between which rows of one agent the stop line lies; interpolated."""
    if len(rows) < 2:
        return np.zeros(0)
    agent, frame = recording.agent[rows], recording.frame[rows]
    over = (agent[1:] == agent[:-1]) & (frame[1:] - frame[:-1] <= 10)
    over &= (along_m[:-1] < stop_m) & (along_m[1:] >= stop_m)
    i = np.flatnonzero(over)
    part = (stop_m - along_m[i]) / np.maximum(along_m[i + 1] - along_m[i], 1e-9)
    return np.asarray((frame[i] + part * (frame[i + 1] - frame[i])) * recording.dt_s, np.float64)


def _share(
    go: Bool[np.ndarray, "signal event"], time_s: Float64[np.ndarray, " event"], end_s: float
) -> Float64[np.ndarray, " signal"]:
    """The share of the time in which each light lets go."""
    length = np.diff(np.append(time_s, max(end_s, float(time_s[-1]))))
    total = max(float(length.sum()), 1e-9)
    return np.asarray((go * length).sum(axis=1) / total, np.float64)


def _alike(state: np.ndarray) -> np.ndarray:
    """The number of the group of lights that always show the same."""
    return np.unique(state, axis=0, return_inverse=True)[1].reshape(-1)
