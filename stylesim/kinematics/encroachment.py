"""Post-encroachment time: how long after one vehicle left a place another one, on a crossing way, entered it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from stylesim.geometry import wrap_angle

CELL_M = 0.5  # chosen: a fifth of a car's width; at 5 m/s a cell is passed in one frame of 0.1 s
COARSE_M = 8.0  # chosen: cells that a first look sorts out by, larger than a car
CROSSING_RAD = np.deg2rad(30.0)  # chosen: below it one follows or overtakes the other, and headway says more
MAX_PET_S = 5.0  # chosen: twice what is called an interaction elsewhere; beyond it nobody waited for anybody


@dataclass(frozen=True, eq=False)
class Encroachments:
    """One row per ordered pair of agents: `first` left the place that `second` entered `pet_s` later.

    The least over all places that both passed; 0 where both were there at once. `frame` is the entry of the second.
    """

    first: Int64[np.ndarray, " pair"]
    second: Int64[np.ndarray, " pair"]
    pet_s: Float64[np.ndarray, " pair"]
    frame: Int64[np.ndarray, " pair"]


def encroachments(
    position_m: Float[np.ndarray, "agent time 2"],
    heading_rad: Float[np.ndarray, "agent time"],
    size_m: Float[np.ndarray, "agent 2"],
    present: Bool[np.ndarray, "agent time"],
    *,
    dt_s: float,
    max_s: float = MAX_PET_S,
) -> Encroachments:
    """Every pair of agents whose boxes passed one place within `max_s` of each other on crossing ways.

    The boxes are laid on a grid of CELL_M; in each cell the next agent to enter is held against the one that was there
    last. Masks must be False where positions are NaN. Allen, Shin and Cooper (1978) define the measure [recalled].
    """
    agent, frame = _candidates(position_m, heading_rad, size_m, present)
    visits = _visits(position_m, heading_rad, size_m, agent, frame)
    return _successions(visits, dt_s=dt_s, max_s=max_s)


def _candidates(
    position_m: Float[np.ndarray, "agent time 2"],
    heading_rad: Float[np.ndarray, "agent time"],
    size_m: Float[np.ndarray, "agent 2"],
    present: Bool[np.ndarray, "agent time"],
) -> tuple[Int64[np.ndarray, " row"], Int64[np.ndarray, " row"]]:
    """(agent, frame) wherever a coarse cell is passed in directions that differ: all others cross nobody."""
    agent, frame = np.nonzero(present)
    if not len(agent):
        return agent, frame
    centre, heading = position_m[agent, frame].astype(np.float64), heading_rad[agent, frame].astype(np.float64)
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1) * (size_m[agent, :1] / 2)
    cells = [np.floor(place / COARSE_M).astype(np.int64) for place in (centre - ahead, centre, centre + ahead)]
    key = np.stack([_key(cell) for cell in cells])
    flat = np.unique(key, return_inverse=True)[1].reshape(key.shape)
    course = np.broadcast_to(heading, key.shape)
    reference = np.zeros(int(flat.max()) + 1)
    reference[flat.ravel()] = course.ravel()  # any visit's will do
    away = np.abs(wrap_angle(course - reference[flat]))
    # Two directions that differ by CROSSING_RAD cannot both be nearer than half of it to the reference.
    crossed = np.zeros(len(reference), bool)
    crossed[flat[away >= CROSSING_RAD / 2]] = True
    # A box reaches into the cells beside its points' as well.
    near = crossed[flat].any(axis=0) | np.isin(_key(cells[1]), _around(key[crossed[flat]]))
    return agent[near], frame[near]


_SIDE = 1 << 24  # cells along one axis of the plane; far more than any site has


def _key(cell: Int64[np.ndarray, "row 2"]) -> Int64[np.ndarray, " row"]:
    """One number for each cell."""
    return np.asarray((cell[:, 0] + _SIDE // 2) * _SIDE + cell[:, 1] + _SIDE // 2)


def _around(key: Int64[np.ndarray, " row"]) -> Int64[np.ndarray, " cell"]:
    """The cells and their eight neighbours."""
    own = np.unique(key)
    return np.unique(np.concatenate([own + dx * _SIDE + dy for dx in (-1, 0, 1) for dy in (-1, 0, 1)]))


@dataclass(frozen=True, eq=False)
class _Visits:
    """Unbroken stays of one agent in one cell, ordered by cell, then by entry."""

    cell: Int64[np.ndarray, " visit"]
    agent: Int64[np.ndarray, " visit"]
    entered: Int64[np.ndarray, " visit"]
    left: Int64[np.ndarray, " visit"]  # last frame in it
    heading_rad: Float64[np.ndarray, " visit"]


def _visits(
    position_m: Float[np.ndarray, "agent time 2"],
    heading_rad: Float[np.ndarray, "agent time"],
    size_m: Float[np.ndarray, "agent 2"],
    agent: Int64[np.ndarray, " row"],
    frame: Int64[np.ndarray, " row"],
) -> _Visits:
    """The cells that each box covers in each of the rows, joined over time."""
    keys, who, when = [], [], []
    for one in np.unique(agent):
        rows = agent == one
        length, width = (float(side) for side in size_m[one])
        # Points no more than a cell apart, the edges among them, so that no cell is skipped.
        lengthwise = np.linspace(-length / 2, length / 2, max(2, int(np.ceil(length / CELL_M)) + 1))
        across = np.linspace(-width / 2, width / 2, max(2, int(np.ceil(width / CELL_M)) + 1))
        along, aside = (grid.ravel() for grid in np.meshgrid(lengthwise, across))
        heading = heading_rad[one, frame[rows]].astype(np.float64)[:, None]
        centre = position_m[one, frame[rows]].astype(np.float64)
        x = centre[:, :1] + np.cos(heading) * along - np.sin(heading) * aside
        y = centre[:, 1:] + np.sin(heading) * along + np.cos(heading) * aside
        cell = np.floor(np.stack([x, y], axis=-1) / CELL_M).astype(np.int64)
        key = np.sort(_key(cell.reshape(-1, 2)).reshape(x.shape), axis=1)
        new = np.diff(key, axis=1, prepend=key[:, :1] - 1) != 0
        keys.append(key[new])
        when.append(np.broadcast_to(frame[rows][:, None], key.shape)[new])
        who.append(np.full(int(new.sum()), one))
    none = np.zeros(0, np.int64)
    cell, who_, when_ = (np.concatenate(part) if part else none for part in (keys, who, when))
    order = np.lexsort((when_, who_, cell))
    cell, who_, when_ = cell[order], who_[order], when_[order]
    begins = np.ones(len(cell), bool)
    begins[1:] = (np.diff(cell) != 0) | (np.diff(who_) != 0) | (np.diff(when_) > 1)
    start = np.flatnonzero(begins)
    stop = np.append(start[1:], len(cell)) - 1 if len(start) else start
    stays = (cell[start], who_[start], when_[start], when_[stop])
    by_entry = np.lexsort((stays[2], stays[0]))
    cell, who_, entered, left = (part[by_entry] for part in stays)
    return _Visits(cell, who_, entered, left, heading_rad[who_, entered].astype(np.float64))


def _successions(visits: _Visits, *, dt_s: float, max_s: float) -> Encroachments:
    """Each visit against the one before it in its cell; the least per ordered pair."""
    before, after = np.arange(len(visits.cell) - 1), np.arange(1, len(visits.cell))
    gap = np.maximum(visits.entered[after] - visits.left[before], 0) * dt_s
    turn = np.abs(wrap_angle(visits.heading_rad[after] - visits.heading_rad[before]))
    counts = (visits.cell[after] == visits.cell[before]) & (visits.agent[after] != visits.agent[before])
    counts &= (turn >= CROSSING_RAD) & (gap <= max_s)
    first, second = visits.agent[before][counts], visits.agent[after][counts]
    gap, frame = gap[counts], visits.entered[after][counts]
    order = np.lexsort((frame, gap, second, first))
    first, second, gap, frame = first[order], second[order], gap[order], frame[order]
    least = np.ones(len(first), bool)
    least[1:] = (np.diff(first) != 0) | (np.diff(second) != 0)
    return Encroachments(first[least], second[least], gap[least], frame[least])
