from __future__ import annotations

import numpy as np

from stylesim.geometry import project
from stylesim.labelers.lanes import match
from stylesim.labelers.leftout import left_out_lines
from stylesim.labelers.roadindex import build
from stylesim.road import Lane, LaneEvidence, Road

from .made import scene_of


def winding(name: str, rng: np.random.Generator, tracks: list[str]) -> Lane:
    turn = np.cumsum(rng.normal(0, 0.2, 25))
    line = np.cumsum(4 * np.stack([np.cos(turn), np.sin(turn)], 1), axis=0) + rng.uniform(-20, 20, 2)
    seen = rng.normal(0, 0.4, (len(tracks), 25)).astype(np.float32)
    seen[rng.random(seen.shape) < 0.4] = np.nan
    seen[:, :3] = np.nan  # points that nobody saw
    seen[0, 3:5] = 0.2  # points that one track alone saw
    seen[1:, 3:5] = np.nan
    return Lane(name, line, width_m=3.0, evidence=LaneEvidence(tuple(tracks), seen))


def roads(seed: int) -> Road:
    rng = np.random.default_rng(seed)
    names = [f"car-{i}" for i in range(7)]
    made = [winding(f"l{k}", rng, names[k : k + 1 + k % 4]) for k in range(7)]
    return Road((*made, Lane("map", np.array([[-50.0, 0], [50, 3]]))), source="inferred")


def test_the_lines_are_those_of_lane_without() -> None:
    road = roads(0)
    lines = left_out_lines(road)
    assert lines is not None
    count = 0
    for track, own in lines.of_track.items():
        for line in own:
            wanted = road.lanes[lines.lane[line]].without(track).centre_line_m
            np.testing.assert_array_equal(lines.point_m[lines.start[line] : lines.start[line + 1]], wanted)
            count += 1
    assert count == sum(len(lane.evidence.track_id) for lane in road.lanes if lane.evidence is not None)
    assert left_out_lines(Road((Lane("map", np.array([[0.0, 0], [9, 0]])),))) is None


def test_offsets_are_those_of_a_projection_on_the_line_without_the_driver() -> None:
    rng = np.random.default_rng(1)
    road = roads(2)
    paths, headings = [], []
    for lane in road.lanes[:7]:
        line = lane.centre_line_m.astype(float)
        paths.append(np.repeat(line[1:21] + rng.normal(0, 1.2, (20, 2)), 2, axis=0))
        headings.append(float(np.arctan2(*(line[12] - line[9])[::-1])))
    tracks = scene_of(paths, headings=headings).tracks
    found = match(tracks, build(road, range_m=100.0), tracks.valid)
    checked = 0
    for agent, name in enumerate(tracks.agent_id):
        for frame in np.flatnonzero(found.lane[agent, :, 0] >= 0):
            lane = road.lanes[found.lane[agent, frame, 0]]
            _, offset, distance, _ = project(
                tracks.position_m[agent, frame : frame + 1], lane.without(name).centre_line_m
            )
            assert abs(found.offset_m[agent, frame, 0] - np.copysign(distance, offset)[0]) < 1e-9
            checked += lane.without(name) is not lane
    assert checked > 50
