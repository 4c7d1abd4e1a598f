"""`RoadIndex`: a road's lanes as flat arrays with a grid over them, so that a million positions find their lane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from stylesim.geometry import arc_length, resampled
from stylesim.labelers.leftout import LeftOutLines, left_out_lines
from stylesim.road import Lane, Road

# Width where a lane does not tell it. Chosen: between the usual 3.25 m in towns and 3.75 m on motorways.
DEFAULT_WIDTH_M = 3.5
# A vehicle is on a lane up to this far beside its edge [ours].
EDGE_TOLERANCE_M = 1.0
# Size of a grid cell. Chosen: two lane widths, so that a cell holds few lanes and a lane few cells.
CELL_M = 8.0
# REFERENCE section 1, context: no junction within 150 m [ours]; looked up every 10 m along a lane (chosen).
JUNCTION_NEAR_M = 150.0
STATION_M = 10.0


@dataclass(frozen=True, eq=False)
class RoadIndex:
    """Lanes as arrays. Segments are the pieces of the centre lines; `cell_*` lists those that reach into a cell."""

    road: Road
    segment_m: Float64[np.ndarray, "segment 6"]  # start x y, unit direction x y, length, arc length at its start
    segment_turn: Float64[np.ndarray, "segment 4"]  # direction at its start and its end, smoothed over the vertex
    segment_lane: Int32[np.ndarray, " segment"]
    reach_m: Float64[np.ndarray, " lane"]  # half width + tolerance
    length_m: Float64[np.ndarray, " lane"]
    limit_mps: Float64[np.ndarray, " lane"]
    cell_start: Int64[np.ndarray, " cell_plus_one"]
    cell_segment: Int32[np.ndarray, " entry"]
    grid_origin: Float64[np.ndarray, " 2"]
    grid_shape: tuple[int, int]
    ahead_start: Int64[np.ndarray, " lane_plus_one"]  # successors within the leader range, nearest first
    ahead_lane: Int32[np.ndarray, " successor"]
    ahead_m: Float64[np.ndarray, " successor"]  # from the end of the lane to the start of that successor
    station_start: Int64[np.ndarray, " lane_plus_one"]
    station_near_junction: Bool[np.ndarray, " station"]
    left_out: LeftOutLines | None  # of lanes that were inferred from tracks


def build(road: Road, *, range_m: float) -> RoadIndex:
    """Index a road for vehicles that look for leaders up to `range_m` ahead."""
    lanes = road.lanes
    lines = [lane.centre_line_m.astype(np.float64) for lane in lanes]
    width = np.array([lane.width_m for lane in lanes], np.float64)
    reach = np.where(np.isfinite(width), width, DEFAULT_WIDTH_M) / 2 + EDGE_TOLERANCE_M
    segments, turns, owner = _segments(lines)
    cell_start, cell_segment, origin, shape = _grid(segments, reach[owner])
    length = np.array([arc_length(line)[-1] for line in lines], np.float64)
    ahead = _successors(lanes, length, range_m)
    stations = _stations(lanes, lines)
    return RoadIndex(
        road=road, segment_m=segments, segment_turn=turns, segment_lane=owner, reach_m=reach, length_m=length,
        limit_mps=np.array([lane.speed_limit_mps for lane in lanes], np.float64),
        cell_start=cell_start, cell_segment=cell_segment, grid_origin=origin, grid_shape=shape,
        ahead_start=_starts([len(a) for a in ahead]),
        ahead_lane=np.array([lane for a in ahead for lane, _ in a], np.int32),
        ahead_m=np.array([metres for a in ahead for _, metres in a], np.float64),
        station_start=_starts([len(s) for s in stations]),
        station_near_junction=np.concatenate(stations) if stations else np.zeros(0, bool),
        left_out=left_out_lines(road),
    )  # fmt: skip


def _starts(counts: list[int]) -> Int64[np.ndarray, " count_plus_one"]:
    return np.concatenate([[0], np.cumsum(np.array(counts, np.int64))]).astype(np.int64)


def _segments(
    lines: list[Float64[np.ndarray, "_ 2"]],
) -> tuple[Float64[np.ndarray, "segment 6"], Float64[np.ndarray, "segment 4"], Int32[np.ndarray, " segment"]]:
    """Pieces of every line that have a length, with the direction blended at the vertices between them."""
    rows, turns, owner = [np.zeros((0, 6))], [np.zeros((0, 4))], [np.zeros(0, np.int32)]
    for index, line in enumerate(lines):
        step = np.diff(line, axis=0)
        length = np.hypot(step[:, 0], step[:, 1])
        keep = length > 0
        if not keep.any():
            continue
        unit = step[keep] / length[keep, None]
        vertex = np.concatenate([unit[:1], unit[:-1] + unit[1:], unit[-1:]])
        vertex /= np.maximum(np.hypot(vertex[:, 0], vertex[:, 1]), 1e-9)[:, None]
        rows.append(np.column_stack([line[:-1][keep], unit, length[keep], arc_length(line)[:-1][keep]]))
        turns.append(np.column_stack([vertex[:-1], vertex[1:]]))
        owner.append(np.full(int(keep.sum()), index, np.int32))
    return np.concatenate(rows), np.concatenate(turns), np.concatenate(owner)


def _grid(
    segments: Float64[np.ndarray, "segment 6"], reach: Float64[np.ndarray, " segment"]
) -> tuple[Int64[np.ndarray, " cells"], Int32[np.ndarray, " entry"], Float64[np.ndarray, " 2"], tuple[int, int]]:
    """Which segments reach into which cell; within a cell in ascending order, so by lane."""
    if not len(segments):
        return np.zeros(2, np.int64), np.zeros(0, np.int32), np.zeros(2), (1, 1)
    start = segments[:, :2]
    end = start + segments[:, 2:4] * segments[:, 4:5]
    low, high = np.minimum(start, end) - reach[:, None], np.maximum(start, end) + reach[:, None]
    origin = low.min(axis=0)
    first = ((low - origin) // CELL_M).astype(np.int64)
    span = ((high - origin) // CELL_M).astype(np.int64) - first + 1
    nx, ny = (int(n) for n in (first + span).max(axis=0))
    entries = span[:, 0] * span[:, 1]
    segment = np.repeat(np.arange(len(segments)), entries)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(entries) - entries, entries)
    x = first[segment, 0] + within // span[segment, 1]
    y = first[segment, 1] + within % span[segment, 1]
    keep = _touches(segments[segment], reach[segment], origin + (np.stack([x, y], 1) + 0.5) * CELL_M)
    cell, segment = (x * ny + y)[keep], segment[keep]
    order = np.lexsort((segment, cell))
    counts = np.bincount(cell, minlength=nx * ny)
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), segment[order].astype(np.int32), origin, (nx, ny)


def _touches(
    segments: Float64[np.ndarray, "entry 6"],
    reach: Float64[np.ndarray, " entry"],
    centre: Float64[np.ndarray, "entry 2"],
) -> Bool[np.ndarray, " entry"]:
    """False where a whole cell is farther from the segment than its reach: long diagonals cross few cells."""
    offset = centre - segments[:, :2]
    along = np.clip((offset * segments[:, 2:4]).sum(axis=1), 0.0, segments[:, 4])
    away = offset - along[:, None] * segments[:, 2:4]
    return np.hypot(away[:, 0], away[:, 1]) <= reach + CELL_M * np.sqrt(0.5)


def _successors(
    lanes: tuple[Lane, ...], length: Float64[np.ndarray, " lane"], range_m: float
) -> list[list[tuple[int, float]]]:
    """For each lane the lanes that begin within `range_m` after its end, by the shortest way, nearest first."""
    number = {lane.lane_id: i for i, lane in enumerate(lanes)}
    following = [[number[s] for s in lane.successors if s in number] for lane in lanes]
    result = []
    for lane in range(len(lanes)):
        best: dict[int, float] = {}
        todo = [(0.0, n) for n in following[lane]]
        while todo:
            metres, at = min(todo)
            todo.remove((metres, at))
            if at in best or metres > range_m:
                continue
            best[at] = metres
            todo += [(metres + float(length[at]), n) for n in following[at] if n not in best]
        result.append(sorted(best.items(), key=lambda item: (item[1], item[0])))
    return result


def _stations(lanes: tuple[Lane, ...], lines: list[Float64[np.ndarray, "_ 2"]]) -> list[Bool[np.ndarray, " station"]]:
    """For each lane, every STATION_M: is a junction lane within JUNCTION_NEAR_M, as the crow flies."""
    from scipy.spatial import cKDTree

    places = [resampled(line, STATION_M) for line in lines]
    junction = [p for lane, p in zip(lanes, places, strict=True) if lane.in_junction]
    if not junction:
        return [np.zeros(len(p), bool) for p in places]
    tree = cKDTree(np.concatenate(junction))
    return [np.isfinite(tree.query(p, distance_upper_bound=JUNCTION_NEAR_M)[0]) for p in places]
