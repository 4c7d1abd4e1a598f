"""Go first or yield: two drivers whose ways come together, at a merge, a ring, a crossing or a change of lane.

The ways are compared on a grid: the first cell that both pass is where they meet. Nobody is asked whose way the other
was on already (who follows), or for whom it was settled.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.evaluation.decisions import FIRST_OR_SECOND, Decision
from stylesim.geometry import arc_length
from stylesim.scene import Scene
from stylesim.tracks import Tracks

BEYOND_S = 3.0  # chosen: of the way after the place; modes that go farther end there and have passed it
POINT_M = 0.5  # chosen: between the points of a way
CELL_M = 2.0  # chosen: under the 3 to 3.75 m between neighbouring lanes
APART_M = 1.75  # chosen: half a lane; who is farther from a way is not on it
LEADS_S = (5.0, 4.5, 4.0, 3.5, 3.0, 2.5, 2.0)  # chosen: before the first arrives; under 2 s nobody can do much
MOST_GAP_S = 3.0  # chosen: between both; drivers accept gaps of 3 to 6 s [recalled: HCM], who comes later meets nobody
# It was open who goes first if the second could have been there before the first, and the first after the second.
QUICKER_MPS2 = 2.6  # SUMO's default for passenger cars; about what drivers use from a standstill
SLOWER_MPS2 = 3.0  # median deceleration of stops at a yellow (Gates et al. 2007, REFERENCE section 5)


@dataclass(frozen=True, eq=False)
class _Way:
    """Where one of both really goes from t0 on, and how far along that the place is."""

    path_m: Float64[np.ndarray, "point 2"]
    station_m: float


@dataclass(frozen=True)
class _Meeting:
    first: int
    second: int
    first_frame: int  # when each enters the place
    second_frame: int


def yield_decisions_of(scene: Scene, steps: int, counts: Counter[str]) -> Iterator[Decision]:
    """Both drivers' decisions of every meeting of a scene, at the first moment at which the order was open.

    Both arrive within `steps` frames after it. The place is on the driver's own way, and who is there before the other
    one really was has gone first.
    """
    tracks = scene.tracks
    events = {frozenset((event["actor"], event["victim"])) for event in scene.metadata.get("events", ())}
    for met in _meetings(tracks, round(MOST_GAP_S / tracks.dt_s)):
        asked = _moment(tracks, met, steps)
        if isinstance(asked, str):
            counts[f"ways that meet: {asked}"] += 1
            continue
        t0, ways = asked
        event = frozenset((tracks.agent_id[met.first], tracks.agent_id[met.second])) in events
        for agent, way, until in (
            (met.first, ways[0], met.second_frame - t0), (met.second, ways[1], met.first_frame - t0)
        ):  # fmt: skip
            went = agent == met.first
            yield Decision(FIRST_OR_SECOND, agent, t0, way.path_m, way.station_m, until, went, event)


def _moment(tracks: Tracks, met: _Meeting, steps: int) -> tuple[int, tuple[_Way, _Way]] | str:
    """(t0, both ways from there) of the first moment at which the order was open, or why there is none."""
    why = "not both seen before it"
    arrivals = ((met.first, met.first_frame), (met.second, met.second_frame))
    for lead_s in LEADS_S:
        t0 = met.first_frame - round(lead_s / tracks.dt_s)
        if t0 < 0 or met.second_frame - t0 > steps or not tracks.valid[[met.first, met.second], t0].all():
            continue
        if _near_way(tracks, met.first, t0, met.second) or _near_way(tracks, met.second, t0, met.first):
            why = "one follows the other"
        elif _open(tracks, met, t0, *(_station_m(tracks, agent, t0, frame) for agent, frame in arrivals)):
            first, second = (_way(tracks, agent, t0, frame) for agent, frame in arrivals)
            return t0, (first, second)
        else:
            why = "the order was never open"
    return why


def _open(tracks: Tracks, met: _Meeting, t0: int, first_m: float, second_m: float) -> bool:
    """Whether the order could have been the other one, by what drivers can do over those distances."""
    pace = [float(np.hypot(*tracks.velocity_mps[agent, t0].tolist())) for agent in (met.first, met.second)]
    early, late = ((frame - t0) * tracks.dt_s for frame in (met.first_frame, met.second_frame))
    hurried = pace[1] * early + QUICKER_MPS2 * early**2 / 2
    until = min(late, pace[0] / SLOWER_MPS2)  # it stands from then on
    held = pace[0] * until - SLOWER_MPS2 * until**2 / 2
    return hurried > second_m and held < first_m


def _meetings(tracks: Tracks, most_frames: int) -> list[_Meeting]:
    """Pairs whose ways meet, where first, if both arrive within `most_frames` of each other; in order of time."""
    agent, frame, cell = _visits(tracks)
    order = np.lexsort((agent, frame, cell))
    agent, frame, cell = agent[order], frame[order], cell[order]
    rows, shift = [np.zeros((0, 4), np.int64)], 1
    while shift < len(cell):
        near = (cell[shift:] == cell[:-shift]) & (frame[shift:] - frame[:-shift] <= most_frames)
        at = np.flatnonzero(near)
        if not len(at):
            break  # rows of a cell are in order of time: farther ones are no nearer
        rows.append(np.stack([agent[at], agent[at + shift], frame[at], frame[at + shift]], axis=1))
        shift += 1
    every = np.concatenate(rows)
    every = every[every[:, 0] != every[:, 1]]
    every = every[np.lexsort((every[:, 3], every[:, 2]))]
    _, first = np.unique(np.sort(every[:, :2], axis=1), axis=0, return_index=True)
    return [_Meeting(*row) for row in every[np.sort(first)].tolist()]


def _visits(
    tracks: Tracks,
) -> tuple[Int64[np.ndarray, " visit"], Int64[np.ndarray, " visit"], Int64[np.ndarray, " visit"]]:
    """(agent, first frame, cell) of every cell that a motor vehicle's centre passes."""
    agent, frame = np.nonzero(tracks.valid & tracks.is_motor[:, None])
    if not len(agent):
        return agent, frame, agent
    square = np.floor(tracks.position_m[agent, frame].astype(np.float64) / CELL_M).astype(np.int64)
    square -= square.min(axis=0)
    cell = square[:, 0] * (square[:, 1].max() + 1) + square[:, 1]
    key = agent * (cell.max() + 1) + cell
    _, first = np.unique(key, return_index=True)  # rows are in order of agent, then frame
    return agent[first], frame[first], cell[first]


def _near_way(tracks: Tracks, agent: int, frame: int, other: int) -> bool:
    """Whether `agent` is, at that frame, on the way that `other` went or will go."""
    way = tracks.position_m[other, tracks.valid[other]].astype(np.float64)
    return bool(np.linalg.norm(way - tracks.position_m[agent, frame], axis=1).min() < APART_M)


def _station_m(tracks: Tracks, agent: int, t0: int, arrival: int) -> float:
    """How far it goes from t0 to where both ways meet."""
    return float(arc_length(tracks.position_m[agent, t0 : arrival + 1])[-1])


def _way(tracks: Tracks, agent: int, t0: int, arrival: int) -> _Way:
    """From t0 to some seconds after the meeting place."""
    last = arrival + 1 + round(BEYOND_S / tracks.dt_s)
    ahead = np.flatnonzero(tracks.valid[agent, t0:last]) + t0
    path = tracks.position_m[agent, ahead].astype(np.float64)
    along = arc_length(path)
    _, keep = np.unique(np.floor(along / POINT_M), return_index=True)
    keep = np.union1d(keep, [len(path) - 1])
    return _Way(path[keep], _station_m(tracks, agent, t0, arrival))
