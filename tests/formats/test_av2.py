import numpy as np
import polars as pl
import pytest

from stylesim.datasets.av2 import scenes
from stylesim.errors import InputError
from stylesim.geometry import project
from stylesim.tracks import AgentKind, TrackFlag
from stylesim.windows import WindowSpec, anchor_frames, target_agents
from tests.formats import av2_files as av2


@pytest.mark.parametrize("columns", [16, 18])
def test_values_are_read_exactly(tmp_path, columns):
    av2.write(tmp_path / "train", columns=columns)
    (scene,) = scenes(tmp_path)
    tracks = scene.tracks
    assert tracks.agent_id == ("7", "8", "89320", "AV")
    assert tracks.kind.tolist() == [AgentKind.PEDESTRIAN, AgentKind.BUS, AgentKind.CAR, AgentKind.CAR]
    assert tracks.valid.sum(axis=1).tolist() == [110, 90, 110, 110]
    np.testing.assert_allclose(tracks.position_m[2, :, 0] + tracks.origin_m[0], 1900.0 + np.arange(110), atol=1e-4)
    assert tracks.flagged(TrackFlag.FOCAL).tolist() == [False, False, True, False]
    assert tracks.flagged(TrackFlag.EGO).tolist() == [False, False, False, True]
    assert (scene.t0_frame, scene.official_split, scene.scenario) == (49, "train", "pittsburgh")
    assert scene.counts["rows_in"] == scene.counts["rows_out"] == 420


def test_the_map(tmp_path):
    av2.write(tmp_path)
    (scene,) = scenes(tmp_path)
    road, origin = scene.road, scene.tracks.origin_m
    assert [lane.lane_id for lane in road.lanes] == ["1", "2", "3"]  # no lane of bicycles
    first, second, third = road.lanes
    np.testing.assert_allclose(first.centre_line_m[:, 1] + origin[1], 600.0, atol=1e-3)
    np.testing.assert_allclose(third.centre_line_m + origin, [[1900, 605], [1925, 605.5], [1950, 605]], atol=1e-3)
    assert first.width_m == pytest.approx(4.0, abs=0.01)
    assert (first.successors, second.successors) == (("2",), ())
    assert (first.left_neighbour, first.right_neighbour) == ("3", "")
    assert (first.in_junction, second.in_junction) == (False, True)
    np.testing.assert_allclose(road.crosswalks_m[0] + origin, [[1960, 590], [1960, 610], [1964, 610], [1964, 590]])


def test_the_test_split_has_fifty_frames(tmp_path):
    av2.write(tmp_path / "test", n_frames=50)
    (scene,) = scenes(tmp_path)
    assert scene.tracks.n_frames == 50
    assert scene.official_split == "test"
    assert anchor_frames(scene, WindowSpec()) == []
    assert len(target_agents(scene, 49, WindowSpec(), need_future=False)) == 3


def test_splits_come_in_order_and_a_scenario_is_its_own_unit(tmp_path):
    for i, split in enumerate(("val", "train", "train")):
        av2.write(tmp_path / split, scenario_id=f"s{i}")
    assert [(s.official_split, s.scene_id) for s in scenes(tmp_path)] == [
        ("train", "av2_s1"), ("train", "av2_s2"), ("val", "av2_s0"),
    ]  # fmt: skip
    (alone,) = scenes(tmp_path / "val" / "s0")
    assert (alone.official_split, alone.unit_id) == ("val", "av2_s0")


def test_what_comes_later_moves_nothing(tmp_path):
    av2.write(tmp_path / "whole")
    av2.write(tmp_path / "cut", frame=av2.table().filter(pl.col("timestep") < 50))
    (whole,), (cut,) = scenes(tmp_path / "whole"), scenes(tmp_path / "cut")
    one, other = whole.history(49, 50), cut.history(49, 50)
    for name in ("position_m", "velocity_mps", "heading_rad", "valid", "origin_m", "size_m"):
        np.testing.assert_array_equal(getattr(one.tracks, name), getattr(other.tracks, name))
    np.testing.assert_array_equal(one.road.lanes[0].centre_line_m, other.road.lanes[0].centre_line_m)


def test_bad_rows_are_counted(tmp_path):
    frame = av2.table()
    bad = frame.head(4).with_columns(
        position_x=pl.Series([float("nan"), 0.0, 0.0, 0.0]),
        timestep=pl.Series([0, 110, 3, 3]),
        velocity_x=pl.Series([0.0, 0.0, 300.0, 0.0]),
    )
    av2.write(tmp_path, frame=pl.concat([frame, bad]))
    (scene,) = scenes(tmp_path)
    assert dict(scene.counts) == {
        "rows_in": 424, "rows_out": 420, "rows_dropped_unreadable": 1, "rows_dropped_implausible": 2,
        "rows_dropped_duplicate": 1,
    }  # fmt: skip


def spoil_parquet(folder, content):
    file = next(folder.glob("*.parquet"))
    file.write_bytes(content(file.read_bytes()))
    return file


@pytest.mark.parametrize(
    "content", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b"PAR1" + bytes(200) + b"PAR1"]
)
def test_a_damaged_parquet_is_named(tmp_path, content):
    file = spoil_parquet(av2.write(tmp_path), content)
    with pytest.raises(InputError, match="damaged or no Parquet") as error:
        list(scenes(tmp_path))
    assert str(file) in str(error.value)


@pytest.mark.parametrize(
    "content", ["", "{", "[]", '{"lane_segments": {"1": {"lane_type": "VEHICLE"}}}', '{"lane_segments": 3}']
)
def test_a_damaged_map_is_named(tmp_path, content):
    folder = av2.write(tmp_path)
    file = next(folder.glob("*.json"))
    file.write_text(content)
    with pytest.raises(InputError, match="Argoverse 2 map") as error:
        list(scenes(tmp_path))
    assert str(file) in str(error.value)


def test_incomplete_copies_are_named(tmp_path):
    with pytest.raises(InputError, match="holds no Argoverse 2 scenario"):
        list(scenes(tmp_path))
    folder = av2.write(tmp_path / "a")
    next(folder.glob("*.json")).unlink()
    with pytest.raises(InputError, match="has no log_map_archive"):
        list(scenes(tmp_path / "a"))
    av2.write(tmp_path / "b", frame=av2.table().drop("heading"))
    with pytest.raises(InputError, match="lacks the columns heading"):
        list(scenes(tmp_path / "b"))
    av2.write(tmp_path / "c", frame=pl.concat([av2.table(), av2.table(scenario_id="other")]))
    with pytest.raises(InputError, match="2 values of scenario_id"):
        list(scenes(tmp_path / "c"))


def test_real_scenarios(shared_data):
    folder = shared_data / "av2"
    if not folder.is_dir():
        pytest.skip(f"no Argoverse 2 scenarios at {folder}")
    found = list(scenes(folder))
    assert [s.tracks.n_agents for s in found] == [40, 58]
    for scene in found:
        assert scene.counts["rows_in"] == scene.counts["rows_out"] == scene.tracks.valid.sum()
        moving = scene.tracks.is_motor & (np.nan_to_num(scene.tracks.speed_mps).mean(axis=1) > 3.0)
        cars = scene.tracks.select(moving & (scene.tracks.valid.sum(axis=1) > 50))
        places = cars.position_m[cars.valid]
        near = np.min([project(places, lane.centre_line_m)[2] for lane in scene.road.lanes], axis=0)
        assert np.median(near) < 1.0
