"""What simulated and recorded traffic are compared in, frame by frame, and the cells that they are matched in.

They are those of Waymo's Sim Agents challenge (Montali et al. 2023 [read]) that need no map beyond lanes, with the
time headway of car following in addition.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.evaluation.following import Following
from stylesim.kinematics import closing_on_neighbours, displaced, time_headway_s
from stylesim.kinematics import time_to_collision_s as time_to_collision
from stylesim.labelers.roadindex import DEFAULT_WIDTH_M
from stylesim.road import Road
from stylesim.scene import Scene

BINS = 120  # chosen: fine enough that a distance is not a matter of the grid (a 120th of each span)
FOLLOWING_HEADWAY_S = 6.0  # chosen: beyond it a driver is taken not to react to the leader
FOLLOWING_SPEED_MPS = 2.0  # chosen: in a standing queue a headway in seconds says nothing
PARKED_M = 1.0  # REFERENCE section 1: who moves less is parked
NEAR_M = 50.0  # chosen: density is counted in a radius of two seconds' way on a motorway


@dataclass(frozen=True)
class Quantity:
    """What is compared: its unit, the span of its histogram (values beyond count in the last bin)."""

    title: str
    unit: str
    low: float
    high: float

    @property
    def width(self) -> float:
        """Of a bin."""
        return (self.high - self.low) / BINS


QUANTITIES: Mapping[str, Quantity] = {
    "speed": Quantity("speed", "m/s", 0.0, 48.0),
    "acceleration": Quantity("acceleration", "m/s²", -6.0, 6.0),
    "jerk": Quantity("jerk", "m/s³", -12.0, 12.0),
    "headway": Quantity("headway when following", "s", 0.0, FOLLOWING_HEADWAY_S),
    "ttc": Quantity("time to collision", "s", 0.0, 24.0),
    "lateral_offset": Quantity("distance from lane centre", "m", 0.0, 2.4),
    "road_edge": Quantity("distance to road edge", "m", -1.0, 11.0),
}

# Edges of the cells that traffic is matched in. Chosen: walking pace, town, rural road and motorway in two steps each;
# alone, few, several, many neighbours.
SPEED_EDGES_MPS = (0.0, 2.0, 5.0, 9.0, 14.0, 19.0, 25.0, 31.0)
DENSITY_EDGES = (0, 1, 3, 6)
CELLS = len(SPEED_EDGES_MPS) * len(DENSITY_EDGES)


def moving_vehicles(scene: Scene, follow: Following) -> Bool[np.ndarray, "agent time"]:
    """Frames of motor vehicles that are not parked and have a motion."""
    tracks = scene.tracks
    run = np.where(tracks.valid, 0, -1).astype(np.int32)
    moved = displaced(tracks.position_m, run, PARKED_M)
    return np.asarray(tracks.valid & tracks.is_motor[:, None] & moved & follow.motion.known)


def cells_of(
    scene: Scene, follow: Following, moving: Bool[np.ndarray, "agent time"]
) -> Int64[np.ndarray, "agent time"]:
    """The cell of each frame: own speed, and moving vehicles within NEAR_M whatever their direction."""
    around = closing_on_neighbours(
        follow.motion, is_ego=moving, is_neighbour=moving, radius_m=NEAR_M, heading_within_rad=float(np.pi),
        distance_floor_m=1.0,
    )  # fmt: skip
    speed = np.searchsorted(SPEED_EDGES_MPS, np.nan_to_num(follow.speed_mps), side="right") - 1
    density = np.searchsorted(DENSITY_EDGES, around.count, side="right") - 1
    return np.asarray(np.maximum(speed, 0) * len(DENSITY_EDGES) + density, np.int64)


def quantities_of(scene: Scene, follow: Following) -> dict[str, Float64[np.ndarray, "agent time"]]:
    """Every quantity of QUANTITIES in every frame; NaN where there is none (no leader, no lane, not closing)."""
    headway = time_headway_s(follow.gap_m, follow.speed_mps)
    following = (follow.speed_mps >= FOLLOWING_SPEED_MPS) & (headway <= FOLLOWING_HEADWAY_S)
    ttc = time_to_collision(follow.gap_m, follow.speed_mps, follow.leader_speed_mps)
    return {
        "speed": follow.speed_mps,
        "acceleration": follow.motion.acceleration_mps2,
        "jerk": follow.motion.jerk_mps3,
        "headway": np.where(following, headway, np.nan),
        "ttc": np.where(np.isfinite(ttc), ttc, np.nan),
        "lateral_offset": np.abs(follow.offset_m),
        "road_edge": _edge_distance(scene, follow),
    }


def _edge_distance(scene: Scene, follow: Following) -> Float64[np.ndarray, "agent time"]:
    """From the vehicle's side to the nearer edge of the road: of the lane and its neighbours side by side.

    NaN without a lane or in a junction, where lanes fan out and the edge is not theirs.
    """
    shape = follow.lane.shape
    if scene.road is None or not scene.road.lanes:
        return np.full(shape, np.nan)
    left, right = _room(scene.road)
    on = follow.lane >= 0
    lane = np.where(on, follow.lane, 0)
    half = np.nan_to_num(scene.tracks.size_m[:, 1].astype(np.float64), nan=0.0)[:, None] / 2
    nearer = np.minimum(left[lane] - follow.offset_m, right[lane] + follow.offset_m) - half
    return np.where(on, nearer, np.nan)


def _room(road: Road) -> tuple[Float64[np.ndarray, " lane"], Float64[np.ndarray, " lane"]]:
    """From each lane's centre to the left and the right edge of its carriageway; NaN in a junction."""
    number = {lane.lane_id: i for i, lane in enumerate(road.lanes)}
    width = np.array([lane.width_m if np.isfinite(lane.width_m) else DEFAULT_WIDTH_M for lane in road.lanes])
    sides = []
    for side in ("left_neighbour", "right_neighbour"):
        room = np.full(len(width), np.nan)
        for i, lane in enumerate(road.lanes):
            if lane.in_junction:
                continue
            room[i], seen, at = width[i] / 2, {i}, number.get(getattr(lane, side), -1)
            while at >= 0 and at not in seen:  # a damaged map may lead in a circle
                room[i] += width[at]
                seen.add(at)
                at = number.get(getattr(road.lanes[at], side), -1)
        sides.append(room)
    return sides[0], sides[1]
