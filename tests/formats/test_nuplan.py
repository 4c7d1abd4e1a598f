import sqlite3

import numpy as np
import pytest

from stylesim.datasets.nuplan import scenes
from stylesim.errors import InputError
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind, TrackFlag
from tests.formats import nuplan_files as nuplan
from tests.formats.world import World


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
