import numpy as np
import polars as pl
import pytest

from stylesim.datasets.av2_sensor import scenes
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.tracks import AgentKind, TrackFlag
from tests.formats import av2_sensor_files as sensor
from tests.formats.world import World


def test_values_are_read_exactly(tmp_path):
    (scene,) = scenes(sensor.write(tmp_path))
    tracks, world = scene.tracks, World(n_frames=60)
    assert tracks.agent_id == ("AV", *(f"uuid-{i}" for i in world.id[1:]))
    assert tracks.kind.tolist() == [AgentKind.CAR] * 5 + [AgentKind.BICYCLE, AgentKind.PEDESTRIAN]
    there = world.valid
    np.testing.assert_array_equal(tracks.valid, there)
    place = tracks.position_m + tracks.origin_m
    np.testing.assert_allclose(place[there], sensor.turned(world.position)[there], atol=1e-4)
    np.testing.assert_allclose(tracks.heading_rad[there], wrap_angle(world.heading + sensor.TURN)[there], atol=1e-6)
    np.testing.assert_allclose(tracks.size_m[1:], world.size[1:], atol=1e-6)
    assert tracks.flagged(TrackFlag.EGO).tolist() == [True] + [False] * 6
    assert (scene.scenario, scene.source_scenario_id, len(scene.road.lanes)) == ("PIT", "log-1", 3)
    assert scene.counts["rows_in"] == scene.counts["rows_out"] == world.steps


def test_velocities_are_not_late_and_know_no_later_frame(tmp_path):
    boxes, _ = sensor.tables()
    (scene,) = scenes(sensor.write(tmp_path / "a"))
    braking = scene.tracks.agent_id.index("uuid-12")
    np.testing.assert_allclose(scene.tracks.speed_mps[braking, 4:], 9.0 - 0.05 * np.arange(4, 60), atol=0.01)
    ahead = scene.tracks.lookahead_steps
    assert ahead[braking].tolist() == [1] + [0] * 59
    assert ahead[2, :8].tolist() == [0, 0, 0, 0, 0, 1, 0, 0] or ahead[2].max() == 1
    late = sensor.BEGIN_NS + 31 * 100_000_000 - 1_000
    moved = boxes.with_columns(tx_m=pl.when(pl.col("timestamp_ns") > late).then(pl.col("tx_m") + 1).otherwise("tx_m"))
    (other,) = scenes(sensor.write(tmp_path / "b", boxes=moved))
    one, two = scene.history(30, 20).tracks, other.history(30, 20).tracks
    for name in ("position_m", "velocity_mps", "valid", "size_m", "origin_m"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    assert one.valid[:, -1].all()


def test_splits_and_logs_without_boxes(tmp_path):
    sensor.write(tmp_path / "test", log="c")
    (tmp_path / "test" / "c" / "annotations.feather").unlink()
    sensor.write(tmp_path / "train", log="b")
    found = list(scenes(tmp_path))
    assert [(s.official_split, s.source_scenario_id) for s in found] == [("test", "c"), ("train", "b")]
    assert found[0].tracks.agent_id == ("AV",)
    assert found[0].counts["rows_in"] == found[0].counts["rows_out"] > 50


def test_bad_rows_are_counted(tmp_path):
    boxes, _ = sensor.tables()
    n = boxes.height
    damaged = boxes.with_row_index().with_columns(
        tx_m=pl.when(pl.col("index") == 3).then(float("nan")).otherwise("tx_m"),
        timestamp_ns=pl.when(pl.col("index") == 8).then(pl.col("timestamp_ns") + 7).otherwise("timestamp_ns"),
        category=pl.when(pl.col("index") == 11).then(None).otherwise("category"),
        length_m=pl.when(pl.col("track_uuid") == "uuid-14").then(90.0).otherwise("length_m"),
    )
    damaged = pl.concat([damaged, damaged[20:22]]).drop("index")
    (scene,) = scenes(sensor.write(tmp_path, boxes=damaged))
    counts = dict(scene.counts)
    assert counts["rows_in"] == n + 2 + 60
    assert counts["rows_dropped_unreadable"] == 2
    assert counts["rows_dropped_no_pose"] == 1
    assert counts["rows_dropped_duplicate"] == 2
    assert counts["rows_dropped_implausible"] > 50
    assert counts["rows_out"] == scene.tracks.valid.sum()


def test_damaged_files_are_named(tmp_path):
    folder = sensor.write(tmp_path / "a")
    file = folder / "annotations.feather"
    file.write_bytes(file.read_bytes()[:500])
    with pytest.raises(InputError, match=r"annotations\.feather"):
        list(scenes(folder))
    boxes, _ = sensor.tables()
    with pytest.raises(InputError, match="lacks the columns qw"):
        list(scenes(sensor.write(tmp_path / "b", boxes=boxes.drop("qw"))))
    with pytest.raises(InputError, match=r"no box at a time|no clock"):
        list(scenes(sensor.write(tmp_path / "c", boxes=boxes.with_columns(pl.col("timestamp_ns") // 1000))))
    with pytest.raises(InputError, match=r"other units|metres"):
        list(scenes(sensor.write(tmp_path / "d", boxes=boxes.with_columns(pl.col("length_m", "width_m") * 3.28))))
    with pytest.raises(InputError, match="holds no sensor log"):
        list(scenes(tmp_path / "d" / "log-1" / "map"))
