import numpy as np
import pytest

from stylesim.datasets import exid, highd, ind
from stylesim.errors import InputError
from stylesim.geometry import project
from stylesim.tracks import AgentKind
from tests.formats import highd_files, levelx_files


def own(name, agent, **options):
    return [r for r in levelx_files.table(name, **options) if r.agent == agent]


def test_values_at_the_frames_of_both_clocks_are_the_sources_own(tmp_path):
    levelx_files.write(tmp_path / "data", "ind")
    (scene,) = ind.scenes(tmp_path)
    tracks = scene.tracks
    assert tracks.kind.tolist() == [AgentKind.CAR] * 5 + [AgentKind.TRUCK, AgentKind.PEDESTRIAN]
    assert (scene.unit_id, scene.scenario) == ("ind_07", "ind_location_1")
    rows = own("ind", 2)
    for frame in range(0, 100, 2):
        place = tracks.position_m[1, frame] + tracks.origin_m
        np.testing.assert_allclose(place, (rows[frame * 5 // 2].x, rows[frame * 5 // 2].y), atol=1e-4)
    assert (tracks.lookahead_steps == 0).all()
    np.testing.assert_allclose(tracks.size_m[6], [0.6, 0.6])  # the file has 0: a common size
    assert scene.counts["tracks_size_by_kind"] == 1


def test_frames_in_between_are_within_a_millimetre_of_the_truth(tmp_path):
    levelx_files.write(tmp_path / "data", "ind")
    (scene,) = ind.scenes(tmp_path)
    truth = own("ind", 2, dt_s=0.1, n_frames=100)
    place = scene.tracks.position_m[1] + scene.tracks.origin_m
    np.testing.assert_allclose(place, [(r.x, r.y) for r in truth], atol=1e-3)
    np.testing.assert_allclose(scene.tracks.velocity_mps[1, 1:, 0], [r.vx for r in truth[1:]], atol=1e-3)


def test_the_map_lies_under_the_tracks_and_takes_the_recordings_limit(tmp_path):
    levelx_files.sample(tmp_path, "ind")
    (scene,) = ind.scenes(tmp_path)
    assert scene.road is not None
    cars = scene.tracks.position_m[:5][scene.tracks.valid[:5]].astype(float)
    near = np.min([project(cars, lane.centre_line_m)[2] for lane in scene.road.lanes], axis=0)
    assert near.max() < 0.3
    assert scene.counts["rows_dropped_unknown_track"] == 1
    assert next(iter(ind.scenes(tmp_path, map="none"))).road is None


def test_exid_of_several_lanes_a_row(tmp_path):
    levelx_files.write(tmp_path / "data", "exid")
    (scene,) = exid.scenes(tmp_path)
    assert scene.tracks.n_agents == 6
    assert scene.road is None


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        ("07_recordingMeta.csv", ",25,", ",2500,", "frameRate is 2500"),
        ("07_recordingMeta.csv", "293486.1", "50.78", "no easting and northing"),
        ("07_recordingMeta.csv", ",25,", ",30,", None),
        ("07_recordingMeta.csv", ",25,", ",10,", "positions move 0.4"),
        ("07_tracks.csv", "xCenter", "xPixel", "lacks the columns xCenter"),
    ],
)
def test_other_rates_and_files_are_refused(tmp_path, file, old, new, says):
    levelx_files.sample(tmp_path, "ind")
    path = tmp_path / "data" / file
    path.write_text(path.read_text().replace(old, new, 1))
    if says is None:  # 30 Hz instead of 25: within what noise allows, so it is read
        assert list(ind.scenes(tmp_path))
        return
    with pytest.raises(InputError, match=says):
        list(ind.scenes(tmp_path))


def test_incomplete_triples_are_named(tmp_path):
    levelx_files.write(tmp_path, "ind")
    (tmp_path / "07_tracksMeta.csv").unlink()
    with pytest.raises(InputError, match=r"07_tracksMeta\.csv is missing"):
        list(ind.scenes(tmp_path))
    with pytest.raises(InputError, match="holds no <nn>_tracks"):
        list(ind.scenes(tmp_path / ".."))


def test_highds_image_is_turned_upright(tmp_path):
    highd_files.sample(tmp_path)
    (scene,) = highd.scenes(tmp_path)
    tracks = scene.tracks
    assert tracks.agent_id == ("1", "2", "3", "4", "5", "6")
    assert tracks.kind.tolist()[3] == AgentKind.TRUCK
    for i, (direction, y, speed) in enumerate(highd_files.VEHICLES.values()):
        np.testing.assert_allclose(tracks.position_m[i, :, 1] + tracks.origin_m[1], -y, atol=0.11)
        assert tracks.velocity_mps[i, 50, 0] == pytest.approx(-speed if direction == 1 else speed)
        assert abs(tracks.heading_rad[i, 50]) == pytest.approx(np.pi if direction == 1 else 0.0, abs=1e-6)
    np.testing.assert_allclose(tracks.size_m[0], [4.6, 1.9], atol=1e-6)
    # The corner of the box plus half of it: the source's frame 26 is its 26th, at 1.0 s: frame 10 here.
    (lines,) = [
        row for row in (tmp_path / "data" / "03_tracks.csv").read_text().splitlines() if row.startswith("26,3,")
    ]
    corner = float(lines.split(",")[2])
    assert tracks.position_m[2, 10, 0] + tracks.origin_m[0] == pytest.approx(corner + 2.3, abs=1e-3)


def test_highds_lanes_come_from_the_markings(tmp_path):
    highd_files.sample(tmp_path)
    (scene,) = highd.scenes(tmp_path)
    lanes = {lane.lane_id: lane for lane in scene.road.lanes}
    assert sorted(lanes) == ["lower_0", "lower_1", "upper_0", "upper_1"]
    assert lanes["upper_0"].centre_line_m[0, 0] > lanes["upper_0"].centre_line_m[-1, 0]
    assert (lanes["upper_0"].left_neighbour, lanes["upper_0"].right_neighbour) == ("upper_1", "")
    assert (lanes["lower_0"].left_neighbour, lanes["lower_0"].right_neighbour) == ("", "lower_1")
    assert lanes["lower_1"].width_m == 3.75
    assert lanes["lower_1"].speed_limit_mps == pytest.approx(36.11)
    for i, name in enumerate(("upper_0", "upper_1", "lower_0", "lower_1")):
        lane = lanes[name]
        offset = project(scene.tracks.position_m[i].astype(float), lane.centre_line_m)[1]
        assert np.abs(offset).max() < 0.25
        # left of the centre line, seen along it, lies the left boundary
        assert project(lane.left_boundary_m.astype(float), lane.centre_line_m)[1].min() > 1.8
