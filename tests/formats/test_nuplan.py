import sqlite3

import numpy as np
import pytest

from stylesim.datasets.maps.projection import utm
from stylesim.datasets.nuplan import map_of, scenes
from stylesim.datasets.nuplan_map import city_map
from stylesim.errors import InputError
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind, TrackFlag
from tests.formats import nuplan_files as nuplan
from tests.formats.world import CROSSWALK, ORIGIN, SPEED_LIMIT_MPS, World


def test_values_are_read_exactly(tmp_path):
    (scene,) = scenes(nuplan.write(tmp_path))
    tracks, world = scene.tracks, World(n_frames=200, dt_s=0.05)
    row = {name: i for i, name in enumerate(tracks.agent_id)}
    order = [row["ego"], *(row[f"000001{i:06x}"] for i in world.id[1:])]
    valid = world.valid[:, ::2]
    np.testing.assert_array_equal(tracks.valid[order], valid)
    place = tracks.position_m[order] + tracks.origin_m
    np.testing.assert_allclose(place[valid], world.position[:, ::2][valid], atol=1e-3)
    np.testing.assert_allclose(tracks.velocity_mps[order][valid], world.velocity[:, ::2][valid], atol=1e-5)
    np.testing.assert_allclose(tracks.size_m[order][1:], world.size[1:], atol=1e-6)
    np.testing.assert_allclose(tracks.size_m[row["ego"]], (5.176, 2.297), atol=1e-6)
    assert tracks.kind[order].tolist() == [AgentKind.CAR] * 5 + [AgentKind.BICYCLE, AgentKind.PEDESTRIAN]
    assert tracks.flagged(TrackFlag.EGO).tolist() == [i == "ego" for i in tracks.agent_id]
    assert scene.scenario == "us-nv-las-vegas-strip"
    kept = int(valid.sum())
    assert dict(scene.counts) == {
        "rows_in": world.steps, "rows_out": kept, "rows_dropped_other_rate": world.steps - kept,
    }  # fmt: skip


def test_lights_hold_for_their_own_frame_only(tmp_path):
    (scene,) = scenes(nuplan.write(tmp_path))
    assert scene.signals.lane_id == (("49585",),)
    state = scene.signals.state[0]
    assert set(state[:50].tolist()) == {SignalState.RED}
    assert set(state[50:].tolist()) == {SignalState.GREEN}
    (scene,) = scenes(
        nuplan.write(tmp_path / "b", damage="DELETE FROM traffic_light_status WHERE rowid BETWEEN 9 AND 40")
    )
    assert SignalState.UNKNOWN in scene.signals.state[0, :40]


@pytest.mark.parametrize(
    ("damage", "reason", "rows"),
    [
        ("UPDATE lidar_box SET x = NULL WHERE rowid IN (5, 6)", "unreadable", 2),
        ("UPDATE lidar_box SET vx = 400 WHERE rowid IN (5, 6, 7)", "implausible", 3),
        ("UPDATE lidar_box SET track_token = x'00' WHERE rowid = 5", "orphan", 1),
        ("DELETE FROM ego_pose WHERE rowid = 3", "unreadable", 1),
        ("INSERT INTO lidar_box SELECT x'01', lidar_pc_token, track_token, x, y, z, width, length, height, vx, vy, vz, "
         "yaw, confidence FROM lidar_box WHERE rowid = 9", "duplicate", 1),
    ],
)  # fmt: skip
def test_bad_rows_are_counted(tmp_path, damage, reason, rows):
    (scene,) = scenes(nuplan.write(tmp_path, damage=damage))
    assert scene.counts[f"rows_dropped_{reason}"] == rows
    lost = sum(n for key, n in scene.counts.items() if key.startswith("rows_dropped_"))
    assert scene.counts["rows_in"] == scene.counts["rows_out"] + lost
    assert scene.counts["rows_out"] == scene.tracks.valid.sum()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ("UPDATE lidar_pc SET timestamp = timestamp * 2", "as fast as the velocities"),
        ("UPDATE lidar_pc SET timestamp = CAST(timestamp * 1.5 AS INTEGER)", "no clock of 0.05 s"),
        ("UPDATE lidar_pc SET timestamp = timestamp + 14000 WHERE rowid = 7", "no clock of 0.05 s"),
        ("UPDATE lidar_box SET x = x * 20, y = y * 20", "other units|as fast as"),
        ("UPDATE lidar_box SET x = x / 0.3048, y = y / 0.3048", "other units|as fast as"),
        ("UPDATE track SET length = length * 3.28", "lengths must be metres"),
        ("UPDATE lidar_box SET yaw = yaw + 1.5", "degrees off the direction of motion"),
        ("DROP TABLE track", "lacks the tables track"),
        ("ALTER TABLE track RENAME TO t; CREATE VIEW track AS SELECT * FROM t", "lacks the tables track"),
        ("DELETE FROM lidar_pc", "holds no frame"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, damage, message):
    file = nuplan.write(tmp_path, damage=damage)
    with pytest.raises(InputError, match=message) as error:
        list(scenes(file))
    assert str(file) in str(error.value)


def test_the_file_is_not_touched(tmp_path):
    file = nuplan.write(tmp_path)
    before = file.read_bytes()
    file.chmod(0o444)
    list(scenes(file))
    assert file.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == [nuplan.NAME]


def test_a_cut_off_log_gives_the_same_history(tmp_path):
    whole = nuplan.write(tmp_path / "whole")
    late = nuplan.BEGIN_US + 50_000 * 100
    cut = nuplan.write(tmp_path / "cut", damage=f"DELETE FROM lidar_pc WHERE timestamp > {late}")
    (one,), (two,) = scenes(whole), scenes(cut)
    a, b = one.history(50, 51).tracks, two.history(50, 51).tracks
    for name in ("agent_id", "position_m", "velocity_mps", "size_m", "valid", "origin_m"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_a_real_log(shared_data):
    folder = shared_data / "nuplan"
    if not folder.is_dir():
        pytest.skip(f"no log of nuPlan at {folder}")
    found = list(scenes(folder))
    (file,) = folder.glob("*.db")
    with sqlite3.connect(f"file:{file}?mode=ro&immutable=1", uri=True) as db:
        rows = sum(db.execute(f"SELECT count(*) FROM {t}").fetchone()[0] for t in ("lidar_box", "lidar_pc"))
    db.close()
    assert sum(s.counts["rows_in"] for s in found) == rows == 2129 + 1280
    ego = [s.tracks.select(s.tracks.flagged(TrackFlag.EGO)) for s in found]
    assert all(t.valid.all() for t in ego)
    steps = np.concatenate([np.hypot(*np.diff(t.position_m[0], axis=0).T) for t in ego]) / 0.1
    stated = np.concatenate([t.speed_mps[0, 1:] for t in ego])
    assert np.abs(steps - stated).mean() < 0.3  # stated speeds are 4 % above the displacement in this log
    assert not any(t.flagged(TrackFlag.IMPLAUSIBLE).any() for t in ego)


def around(file):
    """The road of the first scene with its origin added, by lane."""
    scene = next(iter(scenes(file)))
    return scene, {lane.lane_id: lane for lane in scene.road.lanes}


def test_the_map_beside_the_logs_is_read(tmp_path):
    nuplan.write_map(tmp_path)
    scene, lanes = around(nuplan.write(tmp_path / "nuplan-v1.1" / "splits" / "mini"))
    shift = scene.tracks.origin_m
    assert set(lanes) == {"21", "22", "23", "24", "49585", "49586"}
    first, joint = lanes["21"], lanes["49585"]
    np.testing.assert_allclose(first.centre_line_m + shift, [(1140, -340), (1195, -340), (1250, -340)], atol=1e-3)
    assert first.width_m == pytest.approx(3.5, abs=1e-3)
    assert first.speed_limit_mps == pytest.approx(SPEED_LIMIT_MPS)
    assert np.isnan(lanes["22"].speed_limit_mps)
    assert (first.successors, joint.successors, lanes["22"].successors) == (("49585",), ("22",), ())
    assert (first.left_neighbour, first.right_neighbour) == ("23", "")
    assert (lanes["23"].left_neighbour, lanes["23"].right_neighbour) == ("", "21")
    assert [lanes[i].in_junction for i in ("21", "49585")] == [False, True]
    # The boundary 33 was drawn against the direction of the lane.
    np.testing.assert_allclose(lanes["23"].left_boundary_m[[0, -1], 0] + shift[0], [1140, 1360], atol=1e-3)
    np.testing.assert_allclose(first.stop_line_m + shift, [(1248, -341.75), (1248, -338.25)], atol=1e-3)
    np.testing.assert_allclose(joint.stop_line_m[:, 0] + shift[0], [1248, 1248], atol=1e-3)
    np.testing.assert_allclose(scene.road.crosswalks_m[0] + shift, CROSSWALK, atol=1e-3)
    assert scene.signals.lane_id == (("49585",),)
    without = next(iter(scenes(tmp_path / "nuplan-v1.1" / "splits" / "mini", map="none")))
    assert without.road is None


def test_a_map_in_degrees_comes_to_the_same_place(tmp_path):
    """Degrees are found by Newton's method from the projection that is tested against PROJ."""
    there = np.array([664_000.0, 3_998_000.0])

    def degrees(points):
        wanted, found = points - ORIGIN + there, np.full((len(points), 2), [36.1, -115.2])
        for _ in range(20):
            here = utm(*found.T, zone=11)
            step = [(utm(*(found + d).T, zone=11) - here) / 1e-6 for d in ([1e-6, 0.0], [0.0, 1e-6])]
            found += np.linalg.solve(np.stack(step, -1), (wanted - here)[..., None])[..., 0]
        return found[:, ::-1]

    city = city_map(nuplan.write_map(tmp_path / "a", place=degrees, srs=4326))
    plain = city_map(nuplan.write_map(tmp_path / "b", place=lambda p: p - ORIGIN + there))
    for one, other in zip(city.lanes, plain.lanes, strict=True):
        assert one.lane_id == other.lane_id
        np.testing.assert_allclose(one.centre_line_m, other.centre_line_m, atol=1e-3)


def test_the_road_does_not_know_how_the_scene_goes_on(tmp_path):
    nuplan.write_map(tmp_path)
    whole = nuplan.write(tmp_path / "logs")
    cut = nuplan.write(
        tmp_path / "short", damage=f"DELETE FROM lidar_pc WHERE timestamp > {nuplan.BEGIN_US + 50_000 * 100}"
    )
    (_, lanes), (_, others) = around(whole), around(cut)
    assert list(lanes) == list(others)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ("UPDATE meta SET value = 'epsg:3857'", "no UTM zone"),
        ("UPDATE gpkg_geometry_columns SET srs_id = 3857", "neither degrees nor"),
        ("UPDATE gpkg_geometry_columns SET srs_id = 4326", "not within its zone"),
        ("UPDATE boundaries SET geom = substr(geom, 1, 60)", "cut off"),
        ("UPDATE boundaries SET geom = x'0102'", "does not begin as one"),
        ("UPDATE baseline_paths SET lane_fid = NULL", "no lane with a baseline"),
        ("DROP TABLE boundaries", "lacks the tables boundaries"),
    ],
)
def test_damaged_maps_are_named(tmp_path, damage, message):
    file = nuplan.write_map(tmp_path, damage=damage)
    nuplan.write(tmp_path / "logs")
    with pytest.raises(InputError, match=message) as error:
        list(scenes(tmp_path / "logs"))
    assert str(file) in str(error.value)


def test_lanes_without_a_line_are_counted(tmp_path):
    nuplan.write_map(tmp_path, damage="UPDATE baseline_paths SET lane_fid = NULL WHERE lane_fid = 24")
    scene, lanes = around(nuplan.write(tmp_path / "logs"))
    assert "24" not in lanes
    assert scene.counts["map_lanes_incomplete"] == 1


def test_which_map(tmp_path):
    file = nuplan.write_map(tmp_path)
    log = nuplan.write(tmp_path / "logs")
    assert (
        map_of(log, "us-nv-las-vegas-strip", "") == map_of(log, "us-nv-las-vegas-strip", str(tmp_path / "maps")) == file
    )
    assert map_of(log, "us-ma-boston", "") is None
    with pytest.raises(InputError, match=r"holds no us-ma-boston"):
        map_of(log, "us-ma-boston", str(tmp_path / "maps"))
    for hostile in ("../../etc", "/etc", "..", "a\\b"):
        with pytest.raises(InputError, match="no name of a folder"):
            map_of(log, hostile, "")
    nuplan.write_map(tmp_path / "x")
    (tmp_path / "x/maps/us-nv-las-vegas-strip/9.15.1915").rename(file.parent.parent / "10.0")
    with pytest.raises(InputError, match="2 versions"):
        map_of(log, "us-nv-las-vegas-strip", "")
