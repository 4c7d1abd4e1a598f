"""Lane centre lines made from tracks, where a data set has no map.

Paths that ran in one lane from entry to exit give a movement (`paths`), movements that share a stretch are cut
into lanes (`lane_graph`), and each lane is centred on the median of the vehicles that followed it, station by
station. Their offsets are kept as evidence, so that `Lane.without` leaves a driver out of its own centre.
[ours, after REFERENCE section 1: a lane that is not credible is not there, and s_center is missing]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.datasets.lane_graph import lane_pieces
from stylesim.datasets.paths import SAME_LANE_M, DrivenPath, directions, moved_left, movements, sight, vehicle_paths
from stylesim.datasets.recording import Recording
from stylesim.geometry import project, wrap_angle
from stylesim.road import Lane, LaneEvidence, Road
from stylesim.tracks import MOTOR_KINDS

# Chosen: with the driver himself left out three remain, and the median of three is not any one of them at both sides.
MIN_TRACKS = 4
# Chosen: with a standard deviation of 0.6 m, 95 % of the drivers are within a lane of 2.4 m; beyond it, the tracks
# are of several lanes or of none.
MAX_SPREAD_M = 0.6
MIN_LANE_M = 8  # stations; chosen: a shorter piece than a car and its gap says nothing of lane keeping
FOLLOWS_RAD = np.radians(25)
NEIGHBOUR_M = (2.2, 4.5)  # chosen: the widths of lanes


def infer_road(recording: Recording, origin_m: Float64[np.ndarray, " 2"]) -> Road | None:
    """The credible lanes of a recording, in metres from `origin_m`; None where there is not one."""
    paths = vehicle_paths(recording, origin_m)
    pieces = lane_pieces([line for line, _ in movements(paths, min_tracks=MIN_TRACKS)])
    lanes: dict[int, Lane] = {}
    for number, piece in enumerate(pieces):
        lane = _credible(f"lane_{number:02d}", piece.line_m, paths)
        if lane is not None:
            lanes[number] = replace(lane, in_junction=piece.in_junction)
    for number, lane in lanes.items():
        follow = tuple(lanes[i].lane_id for i in pieces[number].successors if i in lanes)
        lanes[number] = replace(lane, successors=follow)
    found = _with_neighbours(list(lanes.values()))
    return Road(lanes=tuple(found), source="inferred") if found else None


def _credible(lane_id: str, line_m: Float64[np.ndarray, "station 2"], paths: list[DrivenPath]) -> Lane | None:
    """The lane centred on the vehicles that followed it, cut to where it is credible; None if nothing is."""
    offsets = _evidence(line_m, paths)
    if len(offsets) < MIN_TRACKS:
        return None
    stretch = _longest(_credible_stations(np.stack(list(offsets.values()))))
    if stretch.stop - stretch.start < MIN_LANE_M:
        return None
    centre = np.nanmedian(np.stack(list(offsets.values()))[:, stretch], axis=0)
    line = moved_left(line_m[stretch], centre).astype(np.float32)
    tracks = tuple(sorted(track for track, row in offsets.items() if np.isfinite(row[stretch]).any()))
    from_centre = np.stack([offsets[track][stretch] - centre for track in tracks])
    return Lane(lane_id, line, evidence=LaneEvidence(tracks, from_centre.astype(np.float32)))


def _evidence(
    line_m: Float64[np.ndarray, "station 2"], paths: list[DrivenPath]
) -> dict[str, Float64[np.ndarray, " station"]]:
    """Offset of every vehicle that followed the line for as long as it was seen beside it; NaN where it was not.

    A vehicle that leaves the line sideways, or comes to it from the side, is on another lane.
    """
    offsets = {}
    for path in paths:
        view = sight(line_m, path.points_m)
        beside = view.seen & (view.turned_rad < 2 * FOLLOWS_RAD) & (np.abs(view.offset_m) < 4 * SAME_LANE_M)
        on = beside & (np.abs(view.offset_m) < SAME_LANE_M) & (view.turned_rad < FOLLOWS_RAD)
        if on.sum() >= MIN_LANE_M and on.sum() >= 0.95 * beside.sum():
            offsets[path.track_id] = np.where(on, view.offset_m, np.nan)
    return offsets


def _credible_stations(offset_m: Float64[np.ndarray, "track station"]) -> Bool[np.ndarray, " station"]:
    enough = np.isfinite(offset_m).sum(axis=0) >= MIN_TRACKS
    spread = np.full(offset_m.shape[1], np.inf)
    spread[enough] = np.nanstd(offset_m[:, enough], axis=0)
    return spread <= MAX_SPREAD_M


def _longest(good: Bool[np.ndarray, " station"]) -> slice:
    edge = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
    runs = edge.reshape(-1, 2)
    if not len(runs):
        return slice(0, 0)
    first, stop = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return slice(int(first), int(stop))


def _with_neighbours(lanes: Sequence[Lane]) -> list[Lane]:
    """The lanes with the ones that run beside them for half of their length or more."""
    result = []
    for lane in lanes:
        sides = {"left_neighbour": "", "right_neighbour": ""}
        if not lane.in_junction:
            for other in lanes:
                offset = _beside(lane, other)
                if other is not lane and not other.in_junction and NEIGHBOUR_M[0] <= abs(offset) <= NEIGHBOUR_M[1]:
                    sides["left_neighbour" if offset > 0 else "right_neighbour"] = other.lane_id
        result.append(replace(lane, **sides))  # type: ignore[arg-type]
    return result


def _beside(lane: Lane, other: Lane) -> float:
    """How far to the left the other lane runs in the same direction (m); NaN if it does not for half the way."""
    view = sight(lane.centre_line_m.astype(np.float64), other.centre_line_m.astype(np.float64))
    same = view.seen & (view.turned_rad < FOLLOWS_RAD)
    return float(np.median(view.offset_m[same])) if same.mean() >= 0.5 else float("nan")


def lane_share(
    road: Road, recording: Recording, origin_m: Float64[np.ndarray, " 2"], *, within_m: float = 2.0
) -> float:
    """Share of the motor vehicles' rows that lie within `within_m` of a lane that runs in their direction."""
    motor = np.isin(recording.kind, [int(k) for k in MOTOR_KINDS])[recording.agent]
    points, heading = recording.position_m[motor] - origin_m, recording.heading_rad[motor]
    has = np.zeros(len(points), bool)
    for lane in road.lanes:
        _, _, distance, segment = project(points, lane.centre_line_m)
        along = directions(lane.centre_line_m.astype(np.float64))[segment]
        has |= (distance <= within_m) & (np.abs(wrap_angle(along - heading)) < 2 * FOLLOWS_RAD)
    return float(has.mean()) if len(has) else 0.0
