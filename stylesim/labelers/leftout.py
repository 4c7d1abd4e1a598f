"""Inferred centre lines without one of the tracks that made them, so that no driver defines its own centre."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int32, Int64

from stylesim.road import Lane, Road


@dataclass(frozen=True, eq=False)
class LeftOutLines:
    """For every lane and track that it was made from, the centre line of `Lane.without(track)`, as flat arrays."""

    point_m: Float32[np.ndarray, "point 2"]
    start: Int64[np.ndarray, " line_plus_one"]
    lane: Int32[np.ndarray, " line"]
    of_track: dict[str, tuple[int, ...]]  # which lines are without that track

    def of_agents(
        self, agent_id: Sequence[str]
    ) -> tuple[Int64[np.ndarray, " agent_plus_one"], Int64[np.ndarray, " entry"]]:
        """The lines that are without each agent: where each agent's begin, and which they are."""
        lines = [self.of_track.get(name, ()) for name in agent_id]
        start = np.concatenate([[0], np.cumsum([len(own) for own in lines])]).astype(np.int64)
        return start, np.array([line for own in lines for line in own], np.int64)


def left_out_lines(road: Road) -> LeftOutLines | None:
    """The lines of a road; None where no lane says which tracks it was made from."""
    points: list[Float32[np.ndarray, "_ 2"]] = []
    counts: list[int] = []
    owner: list[int] = []
    of_track: dict[str, list[int]] = {}
    for number, lane in enumerate(road.lanes):
        if lane.evidence is None:
            continue
        for track in lane.evidence.track_id:
            of_track.setdefault(track, []).append(len(counts))
            counts.append(len(lane.centre_line_m))
            owner.append(number)
        points.append(_lines_without(lane).reshape(-1, 2))
    if not counts:
        return None
    return LeftOutLines(
        point_m=np.concatenate(points),
        start=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        lane=np.array(owner, np.int32),
        of_track={track: tuple(lines) for track, lines in of_track.items()},
    )


def _lines_without(lane: Lane) -> Float32[np.ndarray, "track point 2"]:
    """`Lane.without` for all tracks of the lane at once, to the same bits."""
    assert lane.evidence is not None
    shift = medians_without(lane.evidence.offset_m).astype(np.float64)
    centre = lane.centre_line_m.astype(np.float64)
    tangent = np.gradient(centre, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    return np.asarray(centre + shift[..., None] * normal, np.float32)


def medians_without(offset_m: Float32[np.ndarray, "track point"]) -> Float32[np.ndarray, "track point"]:
    """For each track and point the median of the other tracks' values there; 0 where no other has one (NaN)."""
    known = ~np.isnan(offset_m)
    order = np.argsort(offset_m, axis=0, kind="stable")  # NaN last
    ascending = np.take_along_axis(offset_m, order, axis=0)
    place = np.argsort(order, axis=0, kind="stable")
    others = known.sum(axis=0) - known
    ends = []
    for index in (np.maximum(others - 1, 0) // 2, others // 2):
        # Of the others in ascending order, those from the track's own place on stand one further in the whole order.
        at = np.minimum(index + (place <= index), len(offset_m) - 1)
        ends.append(np.take_along_axis(ascending, at, axis=0))
    return np.where(others > 0, (ends[0] + ends[1]) / np.float32(2), np.float32(0))
