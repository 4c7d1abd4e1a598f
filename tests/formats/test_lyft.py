import json
import sys

import numpy as np
import pytest

from stylesim.datasets.lyft import scenes
from stylesim.datasets.lyft_map import lyft_map
from stylesim.errors import InputError, MissingDependencyError
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind, TrackFlag
from tests.formats import lyft_files as lyft
from tests.formats.world import CROSSWALK, ORIGIN, SPEED_LIMIT_MPS, World


@pytest.mark.parametrize("packed", [True, False])
def test_values_are_read_exactly(tmp_path, packed):
    (scene,) = scenes(lyft.write(tmp_path, lyft.records(), packed=packed))
    tracks, world = scene.tracks, World(n_frames=60)
    assert tracks.agent_id == ("ego", *(str(i) for i in world.id[1:]))
    assert tracks.kind.tolist() == [AgentKind.CAR] * 5 + [AgentKind.BICYCLE, AgentKind.PEDESTRIAN]
    there = world.valid
    np.testing.assert_array_equal(tracks.valid, there)
    np.testing.assert_allclose((tracks.position_m + tracks.origin_m)[there], world.position[there], atol=1e-4)
    np.testing.assert_allclose(tracks.velocity_mps[there], world.velocity[there], atol=1e-3)
    np.testing.assert_allclose(tracks.size_m[1:], world.size[1:], atol=1e-6)
    assert tracks.flagged(TrackFlag.EGO).tolist() == [True] + [False] * 6
    assert tracks.lookahead_steps[0].tolist() == [1] + [0] * 59  # the ego's first velocity needs a second pose
    assert scene.counts["rows_in"] == scene.counts["rows_out"] == world.steps


def test_scenes_that_follow_one_another_are_one_recording(tmp_path):
    found = list(scenes(lyft.write(tmp_path, lyft.records(n_frames=20, starts_s=(0.0, 2.5, 300.0)))))
    assert len({s.scene_id for s in found}) == 3
    assert found[0].unit_id == found[1].unit_id != found[2].unit_id
    assert [s.start_s for s in found] == pytest.approx([0.0, 2.5, 0.0])


def test_bad_rows_are_counted(tmp_path):
    arrays = lyft.records()
    arrays["agents"]["centroid"][3] = np.nan
    arrays["agents"]["velocity"][4] = 300.0
    arrays["agents"]["track_id"][12] = arrays["agents"]["track_id"][11]
    (scene,) = scenes(lyft.write(tmp_path, arrays))
    steps = World(n_frames=60).steps
    assert dict(scene.counts) == {
        "rows_in": steps, "rows_out": steps - 3, "rows_dropped_unreadable": 1, "rows_dropped_implausible": 1,
        "rows_dropped_duplicate": 1,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda a: a["frames"]["timestamp"].__setitem__(5, lyft.BEGIN_NS), "no clock of 0.1 s"),
        (lambda a: a["frames"]["agent_index_interval"].__setitem__((5, 1), 3), "not in one piece"),
        (lambda a: a["frames"]["agent_index_interval"].__setitem__((-1, 1), 10**9), "rows; 0 to 1000000000"),
        (lambda a: a["scenes"]["frame_index_interval"].__setitem__((0, 1), 0), "has the frames 0 to 0"),
        (lambda a: a["agents"]["centroid"].__imul__(20.0), "other units|as fast as"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, change, message):
    arrays = lyft.records()
    change(arrays)
    store = lyft.write(tmp_path, arrays)
    with pytest.raises(InputError, match=message) as error:
        list(scenes(store))
    assert str(store) in str(error.value)


def test_damaged_chunks_are_named(tmp_path):
    def broken(name, spoil):
        store = lyft.write(tmp_path / name, lyft.records())
        chunk = store / "agents" / "1"
        spoil(store, chunk)
        with pytest.raises(InputError, match="agents"):
            list(scenes(store))

    broken("a", lambda store, chunk: chunk.unlink())
    broken("b", lambda store, chunk: chunk.write_bytes(chunk.read_bytes()[:-1]))
    broken("c", lambda store, chunk: chunk.write_bytes(b""))
    broken("bomb", lambda store, chunk: chunk.write_bytes(b"\x02\x01\x21\x08" + b"\xff" * 8 + b"\x10\x00\x00\x00"))

    def other(key, value):
        def spoil(store, chunk):
            meta = store / "agents" / ".zarray"
            meta.write_text(json.dumps(json.loads(meta.read_text()) | {key: value}))

        return spoil

    for i, (key, value) in enumerate(
        [("chunks", [10**12]), ("shape", [-1]), ("shape", [10**15]), ("compressor", {"id": "zlib"}), ("zarr_format", 3),
         ("dtype", "<f8"), ("dtype", [["centroid", "|O"]]), ("chunks", [])]
    ):  # fmt: skip
        store = lyft.write(tmp_path / f"m{i}", lyft.records())
        other(key, value)(store, None)
        with pytest.raises(InputError):
            list(scenes(store))


def test_without_numcodecs_the_way_out_is_said(tmp_path, monkeypatch):
    store = lyft.write(tmp_path, lyft.records())
    monkeypatch.setitem(sys.modules, "numcodecs.blosc", None)
    with pytest.raises(MissingDependencyError, match=r"stylesim\[lyft\]"):
        list(scenes(store))


def test_the_real_sample(shared_data):
    folder = shared_data / "lyft"
    if not folder.is_dir():
        pytest.skip(f"no Lyft sample at {folder}")
    (scene,) = scenes(folder)
    assert scene.counts["rows_in"] == 20802 + 248
    assert scene.tracks.n_frames == 248
    assert scene.counts["rows_dropped_implausible"] == 1033  # unknown things wider than a lane: hedges and walls
    ego = scene.tracks.select(scene.tracks.flagged(TrackFlag.EGO))
    assert ego.valid.all()
    assert 5.0 < ego.speed_mps.mean() < 15.0


def test_the_map_comes_from_its_frames_on_the_earth_to_the_world(tmp_path):
    site = lyft_map(lyft.write_map(tmp_path))
    lanes = {lane.lane_id: lane for lane in site.city.lanes}
    assert set(lanes) == {"aaaa", "bbbb", "join"}
    assert site.city.incomplete == 1  # the lane without boundaries; the cycle lane is left out on purpose
    first, left, joint = lanes["aaaa"], lanes["bbbb"], lanes["join"]
    for lane, y, ends in ((first, 0.0, (-60, 50)), (left, 3.5, (-60, 50)), (joint, 0.0, (50, 160))):
        np.testing.assert_allclose(lane.centre_line_m[[0, -1]] - ORIGIN, [(x, y) for x in ends], atol=0.02)
        np.testing.assert_allclose(lane.left_boundary_m[:, 1] - ORIGIN[1], y + 1.75, atol=0.02)
        assert lane.width_m == pytest.approx(3.5, abs=0.02)
    assert (first.successors, first.left_neighbour, left.right_neighbour) == (("join",), "bbbb", "aaaa")
    assert [lane.in_junction for lane in (first, joint)] == [False, True]
    assert first.speed_limit_mps == pytest.approx(SPEED_LIMIT_MPS)
    np.testing.assert_allclose(first.stop_line_m - ORIGIN, [(50, 1.75), (50, -1.75)], atol=0.02)
    assert joint.stop_line_m is None
    np.testing.assert_allclose(site.city.crosswalks_m[0], CROSSWALK, atol=0.02)
    assert dict(site.faces_of_lane) == {"aaaa": ("grnF", "redF", "yelF"), "bbbb": ("grnF", "redF")}


def test_faces_have_their_colours_and_lanes_from_the_map(tmp_path):
    lyft.write_map(tmp_path)
    lyft.write(tmp_path / "scenes", lyft.logged(lyft.records(n_frames=60), lyft.phase))
    (scene,) = scenes(tmp_path / "scenes")
    assert {lane.lane_id for lane in scene.road.lanes} == {"aaaa", "bbbb", "join"}
    np.testing.assert_allclose(
        scene.road.lane("aaaa").centre_line_m[-1] + scene.tracks.origin_m - ORIGIN, (50, 0), atol=0.02
    )
    assert dict(zip(scene.signals.signal_id, scene.signals.lane_id, strict=True)) == {
        "grnF+redF+yelF": ("aaaa",), "grnF+redF": ("bbbb",),
    }  # fmt: skip
    green, yellow, red, dark = SignalState.GREEN, SignalState.YELLOW, SignalState.RED, SignalState.DARK
    whole = scene.signals.state[scene.signals.signal_id.index("grnF+redF+yelF")]
    assert whole.tolist() == [green] * 10 + [yellow] * 10 + [red] * 20 + [dark] * 20
    assert scene.counts["map_lanes_incomplete"] == 1
    (without,) = scenes(tmp_path / "scenes", map="none")
    assert without.road is None
    assert without.signals is None


def test_two_colours_at_once_and_faces_that_are_not_logged_are_unknown(tmp_path):
    lyft.write_map(tmp_path)
    arrays = lyft.logged(lyft.records(n_frames=60), lambda t: ("redF", "grnF"))
    arrays["traffic_light_faces"]["face_id"][3 * 30 :] = "else"
    lyft.write(tmp_path / "scenes", arrays)
    (scene,) = scenes(tmp_path / "scenes")
    assert (scene.signals.state == SignalState.UNKNOWN).all()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "holds no lane"),
        (lyft.fragment()[:-1], "damaged or no semantic map"),
        (b"\x12\xff\xff\xff\xff\x0f", "damaged or no semantic map"),
        (lyft.fragment().replace(b"aaaa", b"\xff\xff\xff\xff"), "damaged or no semantic map"),
    ],
)
def test_damaged_maps_are_named(tmp_path, content, message):
    file = lyft.write_map(tmp_path, content)
    lyft.write(tmp_path / "scenes", lyft.logged(lyft.records(), lyft.phase))
    with pytest.raises(InputError, match=message) as error:
        list(scenes(tmp_path / "scenes"))
    assert str(file) in str(error.value)


def test_where_the_map_is_must_be_said(tmp_path):
    file = lyft.write_map(tmp_path)
    (tmp_path / "meta.json").write_text('{"world_to_ecef": [[1, 2], [3, 4]]}')
    with pytest.raises(InputError, match="four by four"):
        lyft_map(file)
    (tmp_path / "meta.json").unlink()
    with pytest.raises(InputError, match=r"no meta\.json beside"):
        lyft_map(file)
