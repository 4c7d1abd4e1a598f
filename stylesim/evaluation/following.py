"""Who follows whom, and how every vehicle moves: what criticality and realism are computed from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.kinematics import Leaders, Motion, motion
from stylesim.labelers import cuts, lanes
from stylesim.labelers.features import road_index
from stylesim.labelers.options import FeatureOptions
from stylesim.scene import Scene


@dataclass(frozen=True, eq=False)
class Following:
    """Per agent and frame: the leader (-1: none), gap, own and leader's speed; NaN where there is none."""

    leader: Int64[np.ndarray, "agent time"]
    gap_m: Float64[np.ndarray, "agent time"]
    speed_mps: Float64[np.ndarray, "agent time"]
    leader_speed_mps: Float64[np.ndarray, "agent time"]
    motion: Motion
    lane: Int64[np.ndarray, "agent time"]  # place among the road's lanes, -1 without one
    offset_m: Float64[np.ndarray, "agent time"]  # from the centre of its lane, left positive; NaN without a lane


def following(scene: Scene, options: FeatureOptions | None = None) -> Following:
    """Who follows whom, and how, in every frame of a scene; motor vehicles only."""
    options = options or FeatureOptions()
    tracks = scene.tracks
    cut = cuts.whole(tracks.valid)
    moved = motion(tracks.position_m, tracks.heading_rad, cut.run, dt_s=tracks.dt_s, smoother=options.smoother)
    vehicle = tracks.valid & tracks.is_motor[:, None]
    index = road_index(scene.road, options.leader_range_m)
    found = None if index is None else lanes.match(tracks, index, vehicle, cut.block)
    ahead: Leaders = lanes.leaders(tracks, moved, found, index, is_vehicle=vehicle, options=options)
    frame = np.broadcast_to(np.arange(tracks.n_frames), ahead.leader.shape)
    of_leader = moved.speed_mps[np.maximum(ahead.leader, 0), frame]
    return Following(
        leader=ahead.leader.astype(np.int64),
        gap_m=ahead.gap_m,
        speed_mps=moved.speed_mps,
        leader_speed_mps=np.where(ahead.leader >= 0, of_leader, np.nan),
        motion=moved,
        lane=np.full(vehicle.shape, -1) if found is None else found.lane[..., 0].astype(np.int64),
        offset_m=np.full(vehicle.shape, np.nan) if found is None else found.offset_m[..., 0].astype(np.float64),
    )
