"""Where the lanes lead from a driver's place at t0: the paths of the baselines that know the road."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from stylesim.forecast import ForecastTask
from stylesim.geometry import arc_length, project
from stylesim.labelers import lanes
from stylesim.labelers.features import road_index
from stylesim.labelers.lanes import LaneMatch
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.roadindex import RoadIndex
from stylesim.road import Lane

MOST_PATHS = 6  # as many as modes are scored (REFERENCE section 4)
MOST_LANES = 64  # of one path; chosen: a loop of short lanes must end
JOINT_M = 0.5  # chosen: two lanes whose ends are nearer than this share a point
SWERVE_M = 20.0  # over which a driver comes back to the centre of his lane, to 1/e; chosen: about 1.5 s in a city


@dataclass(frozen=True, eq=False)
class LanePath:
    """A way ahead. `line_m` begins beside the driver, who is `offset_m` to its left; `lanes` are its lanes in order."""

    line_m: Float64[np.ndarray, "point 2"]
    offset_m: float
    lanes: tuple[str, ...]
    first_along_m: float  # of the driver on the first lane

    def at(self, along_m: Float64[np.ndarray, " step"]) -> Float64[np.ndarray, "step 2"]:
        """Positions after driving that far; beyond its end the path goes straight on."""
        length = arc_length(self.line_m)
        place = np.stack([np.interp(along_m, length, self.line_m[:, k]) for k in (0, 1)], axis=1)
        segment = np.clip(np.searchsorted(length, along_m, side="right") - 1, 0, len(length) - 2)
        step = np.diff(self.line_m, axis=0)[segment]
        ahead = step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9)
        place += np.maximum(along_m - length[-1], 0.0)[:, None] * ahead
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        return np.asarray(place + left * (self.offset_m * np.exp(-along_m / SWERVE_M))[:, None])


def matched(task: ForecastTask, options: FeatureOptions) -> tuple[RoadIndex | None, LaneMatch | None]:
    """The road's index and every vehicle's lane in each frame of the history; None without a road."""
    tracks = task.scene.tracks
    index = road_index(task.scene.road, options.leader_range_m)
    if index is None:
        return None, None
    return index, lanes.match(tracks, index, tracks.valid & tracks.is_motor[:, None])


def paths_ahead(
    task: ForecastTask, agent: int, index: RoadIndex, found: LaneMatch, reach_m: float
) -> tuple[LanePath, ...]:
    """The ways from the agent's lane at t0, straightest first, at most six; () where it is on no lane.

    A centre line that was inferred from this very track is taken without it.
    """
    number = int(found.lane[agent, -1, 0])
    if number < 0:
        return ()
    track_id = task.scene.tracks.agent_id[agent]
    by_id = {lane.lane_id: lane for lane in index.road.lanes}
    first = index.road.lanes[number]
    position = task.scene.tracks.position_m[agent, -1].astype(np.float64)
    line = first.without(track_id).centre_line_m
    along, offset, _, _ = project(position[None], line)
    ways = _continuations(by_id, first, reach_m + float(along[0]))
    made = [_path(way, by_id, track_id, float(along[0]), float(offset[0])) for way in ways]
    return tuple(sorted(made, key=lambda path: round(_bend(path), 6))[:MOST_PATHS])


def _continuations(by_id: Mapping[str, Lane], first: Lane, reach_m: float) -> list[tuple[str, ...]]:
    """Every chain of successors that reaches so far, or ends before."""
    done: list[tuple[str, ...]] = []
    open_ways: list[tuple[tuple[str, ...], float]] = [((first.lane_id,), float(arc_length(first.centre_line_m)[-1]))]
    while open_ways and len(done) < 4 * MOST_PATHS:
        way, length = open_ways.pop(0)
        following = [name for name in by_id[way[-1]].successors if name in by_id]
        if length >= reach_m or not following or len(way) >= MOST_LANES:
            done.append(way)
            continue
        for name in following:
            open_ways.append(((*way, name), length + float(arc_length(by_id[name].centre_line_m)[-1])))
    return done


def _path(way: tuple[str, ...], by_id: Mapping[str, Lane], track_id: str, along_m: float, offset_m: float) -> LanePath:
    lines = [by_id[name].without(track_id).centre_line_m.astype(np.float64) for name in way]
    joined = [lines[0]]
    for before, line in pairwise(lines):
        joined.append(line[1:] if np.hypot(*(line[0] - before[-1])) < JOINT_M else line)
    whole = np.concatenate(joined)
    length = arc_length(whole)
    start = np.array([np.interp(along_m, length, whole[:, k]) for k in (0, 1)])
    rest = whole[length > along_m + 1e-6]
    if not len(rest):  # at the very end of the last lane: on in its direction
        rest = (whole[-1] + (whole[-1] - whole[-2]))[None]
    return LanePath(np.concatenate([start[None], rest]), offset_m, way, along_m)


def _bend(path: LanePath) -> float:
    """How far the direction at the end differs from that at the start, rad."""
    step = np.diff(path.line_m, axis=0)
    first, last = np.arctan2(step[0, 1], step[0, 0]), np.arctan2(step[-1, 1], step[-1, 0])
    return float(abs(np.remainder(last - first + np.pi, 2 * np.pi) - np.pi))
