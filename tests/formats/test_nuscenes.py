import copy
import json

import numpy as np
import pytest

from stylesim.datasets.json_stream import objects
from stylesim.datasets.nuscenes import scenes
from stylesim.datasets.nuscenes_map import arc_points, read_map
from stylesim.errors import InputError
from stylesim.merging.clock import on_common_clock
from stylesim.tracks import AgentKind, TrackFlag
from tests.formats import nuscenes_files as nuscenes
from tests.formats.world import World


def expected(n=30):
    """The world every 0.5 s, on the clock of the first key frame."""
    w = World(n_frames=n * 500 + 200, dt_s=0.001)
    at = np.arange(n) * 500 + 100
    return w.position[:, at] + nuscenes.SHIFT, w.velocity[:, at]


def test_values_are_brought_to_the_clock_of_key_frames(tmp_path):
    one, other = scenes(nuscenes.write(tmp_path))
    tracks = one.tracks
    assert tracks.dt_s == 0.5
    assert tracks.agent_id == ("ego", *(f"i0_{i}" for i in World().id[1:]))
    assert tracks.kind.tolist() == [AgentKind.CAR] * 5 + [AgentKind.BICYCLE, AgentKind.PEDESTRIAN]
    position, velocity = expected()
    there = tracks.valid
    assert there.sum() == 7 * 30 - 4
    np.testing.assert_allclose((tracks.position_m + tracks.origin_m)[there], position[there], atol=0.02)
    np.testing.assert_allclose(tracks.velocity_mps[:, 2:][there[:, 2:]], velocity[:, 2:][there[:, 2:]], atol=0.03)
    np.testing.assert_allclose(tracks.size_m[1:], World().size[1:], atol=1e-6)
    assert tracks.flagged(TrackFlag.EGO).tolist() == [True] + [False] * 6
    assert not tracks.flagged(TrackFlag.IMPLAUSIBLE).any()
    assert one.unit_id == other.unit_id == "nuscenes_n008-2018-08-01"
    assert (one.start_s, other.start_s) == (0.0, pytest.approx(60.0))
    assert one.counts["rows_in"] == one.counts["rows_out"] == there.sum()


def test_nothing_knows_a_later_key_frame(tmp_path):
    content = nuscenes.tables(n_scenes=1)
    (one,) = scenes(nuscenes.write(tmp_path / "a", content))
    later = copy.deepcopy(content)
    for row in later["sample_annotation"]:
        if int(row["token"].split("_")[2]) > 15:
            row["translation"][1] += 2.0
            row["size"][1] += 0.5
    (two,) = scenes(nuscenes.write(tmp_path / "b", later))
    for steps in (5, 10):
        a, b = one.history(15, steps).tracks, two.history(15, steps).tracks
        for name in ("position_m", "velocity_mps", "valid", "size_m"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        assert a.valid[:, -1].all()
    fine = on_common_clock(one)
    assert fine.tracks.dt_s == pytest.approx(0.1)
    assert fine.tracks.lookahead_steps[0, 20:26].tolist() == [0, 4, 3, 2, 1, 0]


def test_the_map(tmp_path):
    (scene, _) = scenes(nuscenes.write(tmp_path))
    road = scene.road
    assert [lane.lane_id for lane in road.lanes] == ["21", "23", "22", "24"]
    lane = road.lane("21")
    assert (lane.successors, lane.in_junction, road.lane("22").in_junction) == (("22",), False, True)
    assert lane.width_m == pytest.approx(3.5, abs=0.01)
    np.testing.assert_allclose(lane.centre_line_m[[0, -1]], [[1140, 560], [1250, 560]], atol=1e-3)
    np.testing.assert_allclose(lane.left_boundary_m[:, 1], 561.75, atol=1e-3)
    np.testing.assert_allclose(lane.stop_line_m, [[1249, 558.25], [1249, 561.75]], atol=0.01)
    assert road.lane("24").stop_line_m is None
    assert len(road.crosswalks_m) == 1
    assert next(iter(scenes(nuscenes.write(tmp_path / "b", with_map=False)))).road is None


def test_arcs_follow_the_circle():
    left = arc_points(
        {"start_pose": [0, 0, 0], "radius": 10.0, "shape": "LSR", "segment_length": [5 * np.pi, 4.0, 0.0]}
    )
    np.testing.assert_allclose(left[-1], [10.0, 14.0], atol=1e-9)  # a quarter circle to the left, then 4 m north
    on_circle = left[: len(left) - 5]
    np.testing.assert_allclose(np.hypot(on_circle[:, 0], on_circle[:, 1] - 10.0), 10.0, atol=1e-9)
    right = arc_points(
        {"start_pose": [0, 0, np.pi / 2], "radius": 2.0, "shape": "RLR", "segment_length": [2 * np.pi, 0, 0]}
    )
    np.testing.assert_allclose(right[-1], [4.0, 0.0], atol=1e-9)  # half a circle to the right
    for broken in (
        {"radius": 0.0},
        {"shape": "LX"},
        {"segment_length": [1e9, 0, 0]},
        {"segment_length": [np.nan, 0, 0]},
    ):
        with pytest.raises((ValueError, KeyError)):
            arc_points({"start_pose": [0, 0, 0], "radius": 9.0, "shape": "LSR", "segment_length": [1, 1, 1]} | broken)


def test_the_test_split_has_only_the_ego_vehicle(tmp_path):
    content = nuscenes.tables(n_scenes=1) | {"sample_annotation": [], "instance": []}
    (scene,) = scenes(nuscenes.write(tmp_path, content, version="v1.0-test"))
    assert scene.tracks.agent_id == ("ego",)
    assert scene.official_split == "test"


def test_bad_rows_are_counted(tmp_path):
    content = nuscenes.tables(n_scenes=1)
    rows = content["sample_annotation"]
    rows[5]["translation"][0] = float("nan")
    rows[40]["instance_token"] = "nobody"
    rows.append({**rows[60], "token": "again"})
    content["ego_pose"] = [row for row in content["ego_pose"] if row["token"] != "p0_20_LIDAR_TOP_True"]
    (scene,) = scenes(nuscenes.write(tmp_path, content))
    assert dict(scene.counts) == {
        "rows_in": 7 * 30 - 4 + 1, "rows_out": 7 * 30 - 4 - 4, "rows_dropped_orphan": 1, "rows_dropped_unreadable": 2,
        "rows_dropped_duplicate": 1, "rows_dropped_velocity_unknown": 1,
    }  # fmt: skip


def _scaled(tables, name, factor):
    for row in tables["sample_annotation"]:
        row[name] = [value * factor for value in row[name]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t["sample"][3].update(timestamp=t["sample"][3]["timestamp"] + 200_000), "no clock of 0.5 s"),
        (lambda t: t["sample"][3].update(next="elsewhere"), "no chain"),
        (lambda t: t["sample"][3].update(next=""), "belong to no scene"),
        (lambda t: t["scene"][0].pop("log_token"), "KeyError"),
        (lambda t: t["sample_annotation"][3].update(translation=[1.0]), "7 numbers, not 8"),
        (
            lambda t: [r.update(translation=[v * 20 for v in r["translation"]]) for r in t["sample_annotation"]],
            "metres",
        ),
        (lambda t: [r.update(size=[v * 3.28 for v in r["size"]]) for r in t["sample_annotation"]], "metres"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, change, message):
    content = nuscenes.tables(n_scenes=1)
    change(content)
    with pytest.raises(InputError, match=message):
        list(scenes(nuscenes.write(tmp_path, content)))


def test_a_location_cannot_lead_out_of_the_data_set(tmp_path):
    content = nuscenes.tables(n_scenes=1)
    content["log"][0]["location"] = "../../../outside"
    (tmp_path / "outside.json").write_text("{}")
    with pytest.raises(InputError, match="leads out of"):
        list(scenes(nuscenes.write(tmp_path / "root", content)))


def test_a_damaged_map_is_named(tmp_path):
    file = tmp_path / "m.json"
    for broken in ({"node": []}, {**nuscenes.expansion(), "arcline_path_3": {"21": [{"start_pose": [0]}]}}):
        file.write_text(json.dumps(broken))
        with pytest.raises(InputError, match=r"m\.json is damaged or no nuScenes map"):
            read_map(file)


def test_lists_are_streamed(tmp_path, monkeypatch):
    file = tmp_path / "x.json"
    rows = [{"token": str(i), "text": "ü, ] }" * (i % 50)} for i in range(500)]
    file.write_text(json.dumps(rows, indent=1, ensure_ascii=False), encoding="utf-8")
    monkeypatch.setattr("stylesim.datasets.json_stream.CHUNK_CHARS", 37)
    assert list(objects(file)) == rows
    for broken in ("{}", "[1]", '[{"a": 1}', '[{"a": ', "[}", ""):
        file.write_text(broken)
        with pytest.raises((ValueError, json.JSONDecodeError)):
            list(objects(file))
