"""Movements that share a stretch of road cut into lanes that follow one another.

The movements come largest first. Where a later one runs within SHARED_M of what earlier ones own, it is on their
lane; where it leaves or joins them, that lane is cut, and the stretch of its own becomes a lane. So an approach
lane is there once, and its left turn and its straight on are its two successors.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.datasets.paths import SAME_LANE_M, directions, sight

# Chosen: two thirds of what separates drivers of one lane; at less, two medians of few tracks are the same lane.
SHARED_M = 1.0
SHARED_RAD = np.radians(15)  # chosen: lanes that cross at a junction meet at more, lanes that diverge begin with less
MIN_STRETCH_M = 10  # stations; chosen: a stretch shorter than two car lengths is a wobble, not a lane
CROSSING_RAD = np.radians(20)  # chosen: merging and diverging lanes meet at less
BLEND_M = 10.0  # chosen: over this length a branch departs from the end of its parent
JUNCTION_MARGIN_M = 4.0  # chosen: a vehicle's length before the first crossing lane the junction begins


@dataclass(frozen=True)
class Stretch:
    """Stations [first, last] of a movement that run along [start_m, stop_m] of what `owner` owns."""

    owner: int
    start_m: float
    stop_m: float


@dataclass(frozen=True, eq=False)
class Piece:
    """One lane of the graph, a point about every metre."""

    line_m: Float64[np.ndarray, "station 2"]
    successors: tuple[int, ...]
    in_junction: bool


def lane_pieces(lines: list[Float64[np.ndarray, "_ 2"]]) -> list[Piece]:
    """The lanes of movements, given largest first; successors are indices into the list."""
    routes: list[list[Stretch]] = []
    owned: list[Bool[np.ndarray, " station"]] = []
    for number, line in enumerate(lines):
        route, own = _route(number, line, lines, owned)
        routes.append(route)
        owned.append(own)
    cuts = _cuts(lines, routes)
    pieces: list[tuple[int, float, float]] = []  # owner, from, to
    for owner in range(len(lines)):
        for stretch in routes[owner]:
            if stretch.owner == owner:
                inner = [c for c in cuts[owner] if stretch.start_m + 5 < c < stretch.stop_m - 5]
                bounds = [stretch.start_m, *inner, stretch.stop_m]
                pieces += [(owner, a, b) for a, b in pairwise(bounds)]
    follows: list[set[int]] = [set() for _ in pieces]
    for route in routes:
        walk = [i for stretch in route for i in _along(stretch, pieces)]
        for before, after in pairwise(walk):
            if before != after:
                follows[before].add(after)
    return _joined(lines, pieces, follows)


def _route(
    number: int,
    line: Float64[np.ndarray, "station 2"],
    lines: list[Float64[np.ndarray, "_ 2"]],
    owned: list[Bool[np.ndarray, " _"]],
) -> tuple[list[Stretch], Bool[np.ndarray, " station"]]:
    """The stretches of a movement in order, and which of its stations it owns."""
    owner = np.full(len(line), number)
    along = np.arange(len(line), dtype=np.float64)
    apart = np.full(len(line), np.inf)
    for other in range(number):
        view = sight(line, lines[other])
        theirs = owned[other][np.clip(np.round(view.along_m).astype(int), 0, len(owned[other]) - 1)]
        distance = np.where(view.seen & theirs & (view.turned_rad < SHARED_RAD), np.abs(view.offset_m), np.inf)
        better = (distance < SHARED_M) & (distance < apart)
        owner[better], along[better], apart[better] = other, view.along_m[better], distance[better]
    runs = _runs(owner, number)
    stretches, own = [], np.zeros(len(line), bool)
    for first, last, who in runs:
        if who == number:
            own[first : last + 1] = True
            stretches.append(Stretch(number, float(first), float(last)))
        else:
            inside = [a for a, o in zip(along[first : last + 1], owner[first : last + 1], strict=True) if o == who]
            stretches.append(Stretch(who, float(min(inside)), float(max(inside))))
    return stretches, own


def _runs(owner: np.ndarray, number: int) -> list[tuple[int, int, int]]:
    """(first, last, owner) of consecutive stations; runs shorter than MIN_STRETCH_M join their longer neighbour."""
    change = np.flatnonzero(np.diff(owner)) + 1
    bounds = [0, *change.tolist(), len(owner)]
    runs = [(a, b - 1, int(owner[a])) for a, b in pairwise(bounds)]
    while len(runs) > 1:
        k = min(range(len(runs)), key=lambda i: runs[i][1] - runs[i][0])
        if runs[k][1] - runs[k][0] + 1 >= MIN_STRETCH_M:
            break
        sides = [i for i in (k - 1, k + 1) if 0 <= i < len(runs)]
        into = max(sides, key=lambda i: runs[i][1] - runs[i][0])
        a, b = min(k, into), max(k, into)
        runs[a : b + 1] = [(runs[a][0], runs[b][1], runs[into][2])]
        merged = [runs[0]]
        for run in runs[1:]:
            if run[2] == merged[-1][2]:
                merged[-1] = (merged[-1][0], run[1], run[2])
            else:
                merged.append(run)
        runs = merged
    return runs


def _cuts(lines: list[Float64[np.ndarray, "_ 2"]], routes: list[list[Stretch]]) -> list[list[float]]:
    """Where each movement's line is cut: where others join or leave it, and where the junction begins and ends."""
    cuts: list[list[float]] = [[] for _ in lines]
    for number, route in enumerate(routes):
        for position, stretch in enumerate(route):
            if stretch.owner != number:
                if position > 0:
                    cuts[stretch.owner].append(stretch.start_m)
                if position < len(route) - 1:
                    cuts[stretch.owner].append(stretch.stop_m)
    for number, line in enumerate(lines):
        at = crossings(line, [other for i, other in enumerate(lines) if i != number])
        if len(at):
            cuts[number] += [at.min() - JUNCTION_MARGIN_M, at.max() + JUNCTION_MARGIN_M]
    return [_apart(sorted(c)) for c in cuts]


def _apart(values: list[float]) -> list[float]:
    kept: list[float] = []
    for value in values:
        if not kept or value - kept[-1] >= MIN_STRETCH_M:
            kept.append(value)
    return kept


def crossings(
    line: Float64[np.ndarray, "station 2"], others: list[Float64[np.ndarray, "_ 2"]]
) -> Float64[np.ndarray, " crossing"]:
    """The stations at which other lines cross this one at more than CROSSING_RAD."""
    at = []
    for other in others:
        view = sight(line, other)
        sign = np.sign(view.offset_m)
        flips = (sign[:-1] * sign[1:] < 0) & view.seen[:-1] & view.seen[1:]
        close = np.abs(view.offset_m[:-1]) < 2 * SAME_LANE_M
        at.append(np.flatnonzero(flips & close & (view.turned_rad[:-1] > CROSSING_RAD)).astype(np.float64))
    return np.concatenate(at) if at else np.zeros(0)


def _along(stretch: Stretch, pieces: list[tuple[int, float, float]]) -> list[int]:
    """The pieces that a stretch runs over, in order: those of which it covers the greater part or MIN_STRETCH_M."""
    found = []
    for index, (owner, start, stop) in enumerate(pieces):
        covered = min(stop, stretch.stop_m) - max(start, stretch.start_m)
        if owner == stretch.owner and covered >= min(MIN_STRETCH_M, 0.5 * (stop - start)):
            found.append(index)
    return sorted(found, key=lambda i: pieces[i][1])


def _joined(
    lines: list[Float64[np.ndarray, "_ 2"]], pieces: list[tuple[int, float, float]], follows: list[set[int]]
) -> list[Piece]:
    """The pieces with their ends drawn to the piece of another owner that they leave or join."""
    cut = [lines[owner][round(a) : round(b) + 1].copy() for owner, a, b in pieces]
    whole = [line.copy() for line in cut]
    for before, after_all in enumerate(follows):
        for after in after_all:
            if pieces[before][0] < pieces[after][0]:  # the later owner is the branch: it gives way
                _blend(whole[after], cut[before][-1] - cut[after][0], at_start=True)
            elif pieces[before][0] > pieces[after][0]:
                _blend(whole[before], cut[after][0] - cut[before][-1], at_start=False)
    result = []
    for index, (owner, a, b) in enumerate(pieces):
        at = crossings(lines[owner], [line for i, line in enumerate(lines) if i != owner])
        crossed = bool(((at > a - 1) & (at < b + 1)).any())
        turn = np.abs(np.unwrap(directions(cut[index]))[[0, -1]] @ [1, -1])
        result.append(Piece(whole[index], tuple(sorted(follows[index])), crossed or bool(turn > np.radians(30))))
    return result


def _blend(line: Float64[np.ndarray, "station 2"], gap: Float64[np.ndarray, " 2"], *, at_start: bool) -> None:
    station = np.arange(len(line), dtype=np.float64)
    away = station if at_start else station[::-1]
    line += np.clip(1 - away / BLEND_M, 0, 1)[:, None] * gap
