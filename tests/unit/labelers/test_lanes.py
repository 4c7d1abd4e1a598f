from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.geometry import project
from stylesim.kinematics import motion
from stylesim.labelers import lanes as on_lanes
from stylesim.labelers.cuts import whole
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.roadindex import build
from stylesim.road import Lane, LaneEvidence, Road
from stylesim.scene import Scene

from .made import LANE_M, clock, lanes, scene_of, straight


def matched(scene: Scene) -> on_lanes.LaneMatch:
    assert scene.road is not None
    return on_lanes.match(scene.tracks, build(scene.road, range_m=100.0), scene.tracks.valid)


def leaders(scene: Scene) -> tuple[list[int], list[float]]:
    index = None if scene.road is None else build(scene.road, range_m=100.0)
    run = whole(scene.tracks.valid).run
    moved = motion(scene.tracks.position_m, scene.tracks.heading_rad, run, dt_s=0.1)
    found = None if index is None else matched(scene)
    led = on_lanes.leaders(scene.tracks, moved, found, index, is_vehicle=scene.tracks.valid, options=FeatureOptions())
    return led.leader[:, 50].tolist(), led.gap_m[:, 50].tolist()


def test_the_lane_is_the_nearest_that_agrees_in_direction() -> None:
    rng = np.random.default_rng(0)
    lines = []
    for _ in range(12):
        turn = np.cumsum(rng.normal(0, 0.15, 20)) + rng.uniform(0, 6.3)
        lines.append(np.cumsum(5 * np.stack([np.cos(turn), np.sin(turn)], 1), axis=0) + rng.uniform(-30, 30, 2))
    road = Road(tuple(Lane(f"l{i}", line, width_m=3.0) for i, line in enumerate(lines)))
    places = np.concatenate([line[3:15] + rng.normal(0, 1.0, (12, 2)) for line in lines])
    heading = rng.uniform(-np.pi, np.pi, len(places))
    tracks = scene_of([np.repeat(p[None], 5, axis=0) for p in places], headings=list(heading)).tracks
    found = on_lanes.match(tracks, build(road, range_m=100.0), tracks.valid)
    for i, (x, y) in enumerate(tracks.position_m[:, 0]):
        best, wanted, wanted_offset = np.inf, -1, np.nan
        for k, lane in enumerate(road.lanes):
            _, offset, distance, segment = project(np.array([[x, y]]), lane.centre_line_m)
            step = np.diff(lane.centre_line_m[segment[0] : segment[0] + 2], axis=0)[0]
            apart = abs(np.angle(np.exp(1j * (np.arctan2(step[1], step[0]) - heading[i]))))
            if distance[0] <= 2.5 and apart < np.radians(50) and distance[0] + 3 * apart < best:
                best, wanted, wanted_offset = distance[0] + 3 * apart, k, np.copysign(distance[0], offset[0])
        if wanted >= 0 and best < 1.0:  # beyond, the blended direction may decide otherwise
            assert found.lane[i, 0, 0] == wanted
            assert found.offset_m[i, 0, 0] == pytest.approx(wanted_offset, abs=1e-4)
        far = all(project(np.array([[x, y]]), lane.centre_line_m)[2][0] > 2.5 for lane in road.lanes)
        assert not far or found.lane[i, 0, 0] == -1
    assert (found.lane[:, 0, 0] >= 0).sum() > 10


def test_a_wrong_way_driver_has_no_lane() -> None:
    assert (matched(scene_of([straight(500, -10)], road=lanes())).lane == -1).all()


def test_the_leader_is_found_through_successors_and_forks() -> None:
    one = Lane("one", np.array([[-100.0, 0], [100, 0]]), width_m=3.5, successors=("left", "ahead"))
    left = Lane("left", np.array([[100.0, 0], [130, 30]]), width_m=3.5)
    ahead = Lane("ahead", np.array([[100.0, 0], [300, 0]]), width_m=3.5, successors=("nowhere",))
    road = Road((one, left, ahead))
    along = straight(30, 10), straight(90, 10)  # at frame 50: x = 80 and 140
    turning = np.array([100, 0]) + (10 + 10 * clock()[:, None] * 0) * np.array([1, 1]) / np.sqrt(2)
    who, gap = leaders(scene_of(along, road=road))
    assert who == [1, -1]
    assert gap[0] == pytest.approx(60 - 4.5, abs=1e-3)
    who, gap = leaders(scene_of([*along, turning], road=road, headings=[0, 0, np.pi / 4]))
    assert who == [2, -1, -1]
    assert gap[0] == pytest.approx(20 + 10 - 4.5, abs=1e-3)


def test_a_vehicle_beside_or_behind_is_no_leader() -> None:
    who, _ = leaders(scene_of([straight(0, 10), straight(20, 10, LANE_M), straight(-30, 10)], road=lanes()))
    assert who == [-1, -1, 0]


def test_off_the_lanes_the_corridor_counts() -> None:
    who, gap = leaders(scene_of([straight(0, 10, -20), straight(30, 10, -20)], road=lanes()))
    assert who == [1, -1]
    assert gap[0] == pytest.approx(25.5, abs=1e-3)


def test_a_driver_never_defines_its_own_centre() -> None:
    line = np.array([[-10.0, 0], [50, 0], [150, 0]])
    seen = np.stack([np.full(3, 0.5), np.full(3, -0.3), np.full(3, -0.3)]).astype(np.float32)
    evidence = LaneEvidence(("car-0", "x", "y"), seen)
    road = Road((Lane("made", line, width_m=3.5, evidence=evidence),), source="inferred")
    found = matched(scene_of([straight(0, 10, 0.5), straight(20, 10, 0.5)], road=road))
    np.testing.assert_allclose(found.offset_m[0, :, 0], 0.8, atol=1e-5)  # from the centre that the others make
    np.testing.assert_allclose(found.offset_m[1, :, 0], 0.5, atol=1e-5)


def test_one_lane_change_is_one_event_and_a_successor_is_none() -> None:
    t = clock()
    change = np.stack([10 * t, LANE_M / (1 + np.exp(-2 * (t - 5)))], axis=1)
    scene = scene_of([change], road=lanes())
    found = on_lanes.straying(matched(scene), whole(scene.tracks.valid), 0.1, FeatureOptions())
    assert found.changes.sum() == 1
    first = Lane("a", np.array([[-10.0, 0], [50, 0]]), width_m=3.5, successors=("b",))
    road = Road((first, Lane("b", np.array([[50.0, 0], [200, 0]]), width_m=3.5)))
    scene = replace(scene_of([straight(0, 10, 0.3)]), road=road)
    found = on_lanes.straying(matched(scene), whole(scene.tracks.valid), 0.1, FeatureOptions())
    assert found.changes.sum() == 0
    np.testing.assert_allclose(found.rate, 0.3, atol=1e-6)
