"""Where vehicles drove, as polylines; and the movements (entry, lane, exit) that many of them share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.datasets.recording import Recording
from stylesim.geometry import project, resampled, wrap_angle
from stylesim.tracks import MOTOR_KINDS

STATION_M = 1.0  # chosen: at a turning radius of 8 m the chord is 2 cm off the arc
MIN_STEP_M = 0.5  # chosen: positions jitter by decimetres while a vehicle stands; that is no path
MIN_PATH_M = 20.0  # chosen: shorter pieces do not tell which movement they belong to
# Chosen: half of a 3 m lane. Two drivers of one lane are rarely farther apart, drivers of two lanes never nearer.
SAME_LANE_M = 1.5
# Chosen: ids end where a vehicle waits, so two tracks of one movement may share only a part of the way.
MIN_SHARED = 0.6
# A foot point this much farther than the lateral offset is an end of the line: the place lies beyond it.
END_TOLERANCE_M = 0.05
# Chosen: pairs grow as its square; 400 paths take about 10 s. More are thinned evenly (evidence uses them all).
MAX_PATHS = 400
SMOOTH_M = 7  # stations in the moving average of a movement's line; chosen: shorter than any turn


@dataclass(frozen=True, eq=False)
class DrivenPath:
    """The way of one vehicle, a point every STATION_M."""

    track_id: str
    points_m: Float64[np.ndarray, "station 2"]


def directions(line_m: Float64[np.ndarray, "station 2"]) -> Float64[np.ndarray, " station"]:
    """Direction of a line at each station (rad), over three stations to either side."""
    n = len(line_m)
    index = np.arange(n)
    ahead, behind = np.minimum(index + 3, n - 1), np.maximum(index - 3, 0)
    step = line_m[ahead] - line_m[behind]
    return np.arctan2(step[:, 1], step[:, 0])


def vehicle_paths(recording: Recording, origin_m: Float64[np.ndarray, " 2"]) -> list[DrivenPath]:
    """The path of every motor vehicle that went MIN_PATH_M or farther, longest first."""
    motor = np.isin(recording.kind, [int(kind) for kind in MOTOR_KINDS])
    bounds = np.searchsorted(recording.agent, np.arange(len(recording.agent_id) + 1))
    paths = []
    for agent in np.flatnonzero(motor).tolist():
        points = _moving(recording.position_m[bounds[agent] : bounds[agent + 1]] - origin_m)
        if len(points) >= 2:
            line = resampled(points, STATION_M)
            if (len(line) - 1) * STATION_M >= MIN_PATH_M:
                paths.append(DrivenPath(recording.agent_id[agent], line))
    return sorted(paths, key=lambda path: (-len(path.points_m), path.track_id))


def _moving(points: Float64[np.ndarray, "frame 2"]) -> Float64[np.ndarray, "kept 2"]:
    kept = [points[0]]
    for point in points[1:]:
        if np.hypot(*(point - kept[-1])) >= MIN_STEP_M:
            kept.append(point)
    return np.array(kept)


@dataclass(frozen=True, eq=False)
class Sight:
    """One line seen from the stations of another; `seen` where the other passes within its ends."""

    offset_m: Float64[np.ndarray, " station"]
    turned_rad: Float64[np.ndarray, " station"]
    along_m: Float64[np.ndarray, " station"]
    seen: Bool[np.ndarray, " station"]


def sight(line_m: Float64[np.ndarray, "station 2"], other_m: Float64[np.ndarray, "point 2"]) -> Sight:
    """For each station of a line: how far to its left the other line passes, at what angle, and where."""
    along, offset, distance, segment = project(line_m, other_m)
    turned = np.abs(wrap_angle(directions(other_m)[segment] - directions(line_m)))
    inside = distance <= np.abs(offset) + END_TOLERANCE_M
    return Sight(offset_m=-offset, turned_rad=turned, along_m=along, seen=inside)


def path_distance(one: DrivenPath, other: DrivenPath) -> float:
    """How far apart two paths run where both were seen (90th percentile, m); infinite if they share too little."""
    coarse = one.points_m[::10, None] - other.points_m[None, ::10]
    near = (np.hypot(coarse[..., 0], coarse[..., 1]).min(axis=1) < 10 * STATION_M).mean()
    if near < MIN_SHARED / 2:  # no need to look closer: most of the one path is nowhere near the other
        return float("inf")
    worst = 0.0
    for line, reference in ((one, other), (other, one)):
        _, offset, distance, _ = project(line.points_m[::4], reference.points_m)
        seen = distance <= np.abs(offset) + END_TOLERANCE_M
        if seen.mean() < MIN_SHARED:
            return float("inf")
        worst = max(worst, float(np.percentile(distance[seen], 90)))
    return worst


def movements(paths: list[DrivenPath], *, min_tracks: int) -> list[tuple[Float64[np.ndarray, "station 2"], int]]:
    """The line and number of paths of each group of `min_tracks` or more that ran in one lane from entry to exit.

    Groups by average linkage of `path_distance` at SAME_LANE_M; largest first.
    """
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.spatial.distance import squareform

    if len(paths) < max(2, min_tracks):
        return []
    if len(paths) > MAX_PATHS:
        paths = [paths[i] for i in np.linspace(0, len(paths) - 1, MAX_PATHS).astype(int)]
    apart = np.zeros((len(paths), len(paths)))
    for i, one in enumerate(paths):
        for j in range(i):
            apart[i, j] = apart[j, i] = min(path_distance(one, paths[j]), 100.0)
    group = fcluster(linkage(squareform(apart), "average"), SAME_LANE_M, "distance")
    members = [np.flatnonzero(group == g) for g in np.unique(group)]
    members = sorted((m for m in members if len(m) >= min_tracks), key=lambda m: (-len(m), m[0]))
    return [(middle_line([paths[i].points_m for i in m], min_tracks=min_tracks), len(m)) for m in members]


def middle_line(lines: list[Float64[np.ndarray, "_ 2"]], *, min_tracks: int) -> Float64[np.ndarray, "station 2"]:
    """The robust mean of lines that run beside one another: the median offset at each station, smoothed.

    The longest line is the first guess, improved twice; stations that fewer than `min_tracks` saw are cut off.
    """
    line = max(lines, key=len)
    for _ in range(2):
        views = [sight(line, other) for other in lines]
        offset = np.stack(
            [np.where(v.seen & (np.abs(v.offset_m) < 2 * SAME_LANE_M), v.offset_m, np.nan) for v in views]
        )
        enough = np.flatnonzero(np.isfinite(offset).sum(axis=0) >= min_tracks)
        stretch = slice(enough[0], enough[-1] + 1) if len(enough) > SMOOTH_M else slice(None)
        counted = np.isfinite(offset[:, stretch]).any(axis=0)
        shift = np.zeros(len(counted))
        shift[counted] = np.nanmedian(offset[:, stretch][:, counted], axis=0)
        line = resampled(moved_left(line[stretch], smoothed(shift)), STATION_M)
    return line


def smoothed(values: Float64[np.ndarray, " station"]) -> Float64[np.ndarray, " station"]:
    """A moving average over SMOOTH_M stations, narrower towards the ends."""
    n, half = len(values), SMOOTH_M // 2
    total = np.concatenate([[0.0], np.cumsum(values)])
    reach = np.minimum(half, np.minimum(np.arange(n), n - 1 - np.arange(n)))
    index = np.arange(n)
    return (total[index + reach + 1] - total[index - reach]) / (2 * reach + 1)


def moved_left(
    line_m: Float64[np.ndarray, "station 2"], shift_m: Float64[np.ndarray, " station"]
) -> Float64[np.ndarray, "station 2"]:
    """A line with each station moved to its left."""
    angle = directions(line_m)
    return line_m + shift_m[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
