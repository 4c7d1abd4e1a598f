"""The features of driving style of every agent of a scene, for TDBM and KDSC alike."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int, Int32

from stylesim.kinematics import Motion, closing_on_neighbours, displaced, motion
from stylesim.labelers import cuts, lanes
from stylesim.labelers.context import highway_share
from stylesim.labelers.cuts import Cut
from stylesim.labelers.joining import one_after_another
from stylesim.labelers.lanes import LaneMatch
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.reduce import frame_count, moments
from stylesim.labelers.roadindex import RoadIndex, build
from stylesim.labels import LabelFlag
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.tracks import Tracks

TDBM_FEATURES = ("s_center", "v_nei", "s_front", "v_avg", "j_l")
KDSC_FEATURES = (
    "mean_speed", "max_speed", "var_speed", "mean_acceleration", "max_abs_acceleration", "var_acceleration",
    "mean_jerk", "var_jerk", "std_jerk",
)  # fmt: skip
FEATURES = TDBM_FEATURES + KDSC_FEATURES

# A feature that needs a lane is missing where less than half of the window's frames have one [ours].
LEAST_LANE_SHARE = 0.5
# Beyond what tyres hold (about 1 g) with a margin: the position, not the driver, did that. Chosen.
IMPLAUSIBLE_MPS2 = 12.0


@dataclass(frozen=True, eq=False)
class WindowFeatures:
    """Features per agent and window, in SI units, NaN where missing; `frames` is 0 where there is no window.

    `s_front` without any leader is the leader range, with the flag NO_LEADER. `highway` is the share of the window's
    frames on a highway.
    """

    value: Float64[np.ndarray, "agent window feature"]
    frames: Int32[np.ndarray, "agent window"]
    highway: Float64[np.ndarray, "agent window"]
    flags: Int32[np.ndarray, "agent window"]
    length_steps: int

    @property
    def full(self) -> Bool[np.ndarray, "agent window"]:
        """Windows that hold (nearly) all of their frames."""
        return self.frames >= cuts.FULL_SHARE * self.length_steps

    def at(self, agent: Int[np.ndarray, "#row #window"], window: Int[np.ndarray, "#row #window"]) -> WindowFeatures:
        """Chosen windows of chosen agents: one row for each row of the (broadcast) indices."""
        names = ("value", "frames", "highway", "flags")
        return WindowFeatures(
            **{name: getattr(self, name)[agent, window] for name in names}, length_steps=self.length_steps
        )

    def column(self, name: str) -> Float64[np.ndarray, "agent window"]:
        """One feature."""
        return self.value[..., FEATURES.index(name)]


def window_features(scene: Scene, start: int, length_steps: int, options: FeatureOptions) -> WindowFeatures:
    """Features of the one window [start, start + length_steps): cut first, then smoothed; other frames play no part.

    ValueError if the window is not within the scene.
    """
    tracks = scene.tracks.frames(start, start + length_steps)
    return _features(tracks, scene.road, cuts.whole(tracks.valid), options)


def joint_features(scenes: Sequence[Scene], options: FeatureOptions) -> WindowFeatures:
    """Features of each scene as a whole, one window for each, to the same bits as one by one; in one go since short
    scenes are quickly worked out but slowly called. ValueError unless all have one road, length and set of agents.
    """
    first = scenes[0]
    length, agents = first.tracks.n_frames, first.tracks.agent_id
    if any(s.road is not first.road or s.tracks.n_frames != length or s.tracks.agent_id != agents for s in scenes):
        raise ValueError("scenes of one road, length and set of agents are wanted")
    seen = np.logical_or.reduce([s.tracks.valid.any(axis=1) for s in scenes])
    tracks = one_after_another([s.tracks for s in scenes], seen)
    found = _features(tracks, first.road, cuts.blocks(tracks.valid, length), options)
    shape = (len(agents), len(scenes))
    result = WindowFeatures(
        value=np.full((*shape, len(FEATURES)), np.nan),
        frames=np.zeros(shape, np.int32),
        highway=np.full(shape, np.nan),
        flags=np.zeros(shape, np.int32),
        length_steps=length,
    )
    for name in ("value", "frames", "highway", "flags"):
        getattr(result, name)[seen] = getattr(found, name)
    return result


def tiled_features(scene: Scene, length_steps: int, options: FeatureOptions) -> WindowFeatures:
    """Features of each agent's own windows of that length, side by side from its first frame to its last."""
    return _features(scene.tracks, scene.road, cuts.tiles(scene.tracks.valid, length_steps), options)


_INDICES: OrderedDict[tuple[int, float], RoadIndex] = OrderedDict()
# Roads remembered with their index. Chosen: a few sites in turn; each may hold some MB.
_INDICES_KEPT = 4


def road_index(road: Road | None, range_m: float) -> RoadIndex | None:
    """The index of a road, remembered for the roads used last; None where there is no lane."""
    if road is None or not road.lanes:
        return None
    key = (id(road), range_m)  # the index holds the road, so its id cannot be reused while it is remembered
    if key not in _INDICES:
        _INDICES[key] = build(road, range_m=range_m)
        while len(_INDICES) > _INDICES_KEPT:
            _INDICES.popitem(last=False)
    _INDICES.move_to_end(key)
    return _INDICES[key]


def _features(tracks: Tracks, road: Road | None, cut: Cut, options: FeatureOptions) -> WindowFeatures:
    index = road_index(road, options.leader_range_m)
    moved = motion(tracks.position_m, tracks.heading_rad, cut.run, dt_s=tracks.dt_s, smoother=options.smoother)
    vehicle = tracks.valid & tracks.is_motor[:, None]
    found = None if index is None else lanes.match(tracks, index, vehicle, cut.block)
    frames = frame_count(tracks.valid, cut).astype(np.int32)
    flags = np.zeros(frames.shape, np.int32)
    columns = _kinematic(moved, cut)
    columns["s_center"] = _centre(tracks, found, cut, frames, flags, options)
    columns["v_nei"] = _neighbours(tracks, moved, vehicle, cut, flags, options)
    follow = lanes.leaders(tracks, moved, found, index, is_vehicle=vehicle, options=options)
    has_leader = frame_count(follow.leader >= 0, cut) > 0
    columns["s_front"] = np.where(has_leader, moments(follow.gap_m, cut).mean, options.leader_range_m)
    columns["s_front"][frames == 0] = np.nan
    flags[~has_leader & (frames > 0)] |= LabelFlag.NO_LEADER
    flags[columns["max_abs_acceleration"] > IMPLAUSIBLE_MPS2] |= LabelFlag.IMPLAUSIBLE
    result = WindowFeatures(
        value=np.stack([columns[name] for name in FEATURES], axis=-1),
        frames=frames,
        highway=highway_share(moved, found, index, is_vehicle=vehicle, cut=cut),
        flags=flags,
        length_steps=cut.length_steps,
    )
    flags[~result.full & (frames > 0)] |= LabelFlag.SHORT
    return result


def _kinematic(moved: Motion, cut: Cut) -> dict[str, Float64[np.ndarray, "agent window"]]:
    speed, acceleration = moments(moved.speed_mps, cut), moments(moved.acceleration_mps2, cut)
    jerk = moments(moved.jerk_mps3, cut)
    return {
        "v_avg": speed.mean,
        "j_l": moments(np.abs(moved.jerk_mps3), cut).mean,
        "mean_speed": speed.mean,
        "max_speed": speed.maximum,
        "var_speed": speed.variance,
        "mean_acceleration": acceleration.mean,
        "max_abs_acceleration": moments(np.abs(moved.acceleration_mps2), cut).maximum,
        "var_acceleration": acceleration.variance,
        "mean_jerk": jerk.mean,
        "var_jerk": jerk.variance,
        "std_jerk": np.sqrt(jerk.variance),
    }


def _centre(
    tracks: Tracks,
    found: LaneMatch | None,
    cut: Cut,
    frames: Int32[np.ndarray, "agent window"],
    flags: Int32[np.ndarray, "agent window"],
    options: FeatureOptions,
) -> Float64[np.ndarray, "agent window"]:
    """s_center, the mean of |d| (mu + |dd/dt|) over the frames whose lane is known."""
    if found is None:
        flags[frames > 0] |= LabelFlag.NO_LANE
        return np.full(frames.shape, np.nan)
    rate = moments(lanes.straying(found, cut, tracks.dt_s, options).rate, cut)
    missing = rate.count < LEAST_LANE_SHARE * frames
    flags[missing] |= LabelFlag.NO_LANE
    return np.where(missing, np.nan, rate.mean)


def _neighbours(
    tracks: Tracks,
    moved: Motion,
    vehicle: Bool[np.ndarray, "agent time"],
    cut: Cut,
    flags: Int32[np.ndarray, "agent window"],
    options: FeatureOptions,
) -> Float64[np.ndarray, "agent window"]:
    """v_nei, the mean over the window of the closing speeds weighed by nearness; 0 and flagged without neighbours."""
    everyone = options.neighbours == "all"
    driving = tracks.valid if everyone else vehicle & displaced(tracks.position_m, cut.run, options.parked_within_m)
    closing = closing_on_neighbours(
        moved,
        is_ego=vehicle,
        is_neighbour=driving,
        radius_m=options.radius_m,
        heading_within_rad=float(np.pi if everyone else np.radians(options.neighbour_heading_deg)),
        distance_floor_m=options.distance_floor_m,
    )
    alone = frame_count(closing.count > 0, cut) == 0
    flags[alone & (frame_count(tracks.valid, cut) > 0)] |= LabelFlag.NO_NEIGHBOURS
    return moments(np.where(moved.known, closing.rate_per_s, np.nan), cut).mean
