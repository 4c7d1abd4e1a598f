import numpy as np
import pytest

from stylesim.datasets.polyline_map import meeting
from stylesim.datasets.tfrecord import crc32c, framed, records
from stylesim.datasets.womd import scenes
from stylesim.errors import InputError
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind, TrackFlag
from tests.formats import proto_writer
from tests.formats import womd_files as womd
from tests.formats.world import CROSSWALK, LANES, STOP, World


@pytest.mark.parametrize("encode", [womd.scenario, womd.example])
def test_values_are_read_exactly(tmp_path, encode):
    (scene,) = scenes(womd.write(tmp_path, encode(womd.tree())))
    tracks, world = scene.tracks, World()
    assert tracks.agent_id == tuple(str(i) for i in world.id)
    assert tracks.kind.tolist() == [AgentKind.CAR] * 5 + [AgentKind.BICYCLE, AgentKind.PEDESTRIAN]
    np.testing.assert_array_equal(tracks.valid, world.valid)
    there = world.valid
    atol = 1e-4 if encode is womd.scenario else 2e-4  # doubles; floats of coordinates about 1,200 m
    np.testing.assert_allclose((tracks.position_m + tracks.origin_m)[there], world.position[there], atol=atol)
    np.testing.assert_allclose(tracks.velocity_mps[there], world.velocity[there], atol=1e-5)
    np.testing.assert_allclose(tracks.heading_rad[there], world.heading[there], atol=1e-6)
    np.testing.assert_allclose(tracks.size_m, world.size, atol=1e-6)
    assert tracks.flagged(TrackFlag.EGO).tolist() == [True] + [False] * 6
    assert tracks.flagged(TrackFlag.FOCAL).tolist() == [False, True] + [False] * 5
    assert not tracks.flagged(TrackFlag.IMPLAUSIBLE).any()
    assert (scene.t0_frame, scene.official_split, scene.source_scenario_id) == (10, "train", "abc")
    assert scene.counts["rows_in"] == scene.counts["rows_out"] == world.steps


@pytest.mark.parametrize("encode", [womd.scenario, womd.example])
def test_map_and_lights(tmp_path, encode):
    (scene,) = scenes(womd.write(tmp_path, encode(womd.tree())))
    road, origin = scene.road, scene.tracks.origin_m
    assert [lane.lane_id for lane in road.lanes] == list(LANES)
    assert [lane.successors for lane in road.lanes] == [("22",), (), ("24",), ()]
    for lane in road.lanes:
        np.testing.assert_allclose(lane.centre_line_m + origin, LANES[lane.lane_id], atol=1e-4)
    np.testing.assert_allclose(road.crosswalks_m[0] + origin, CROSSWALK, atol=1e-4)
    stop = road.lane("21").stop_line_m + origin
    np.testing.assert_allclose(stop, STOP + np.array([[0.0, -1.75], [0.0, 1.75]]), atol=1e-3)
    assert scene.signals.lane_id == (("21",),)
    assert scene.signals.state[0].tolist() == [SignalState.RED] * 40 + [SignalState.GREEN] * 51
    if encode is womd.scenario:
        lane = road.lane("21")
        assert lane.speed_limit_mps == pytest.approx(13.4112)
        assert lane.width_m == pytest.approx(3.5, abs=1e-3)
        np.testing.assert_allclose(lane.left_boundary_m[:, 1] + origin[1], LANES["21"][0, 1] + 1.75, atol=1e-3)
        assert (lane.left_neighbour, lane.right_neighbour) == ("23", "")


def test_states_in_another_layout_are_read_the_same(tmp_path):
    """A writer may leave fields out or change their order: then the quick way does not apply."""

    def shuffled(values):
        if values is None:
            return proto_writer.integer(11, 0)
        parts = [proto_writer.double(i + 2, values[i]) for i in (1, 0)]  # no height, y first
        parts += [proto_writer.single(i + 2, values[i]) for i in range(3, 9)]
        return b"".join(parts) + proto_writer.integer(11, values[9])

    plain = womd.scenario(womd.tree())
    original, womd._state = womd._state, shuffled
    try:
        other = womd.scenario(womd.tree())
    finally:
        womd._state = original
    (one,), (two,) = (scenes(womd.write(tmp_path / n, c)) for n, c in (("a", plain), ("b", other)))
    for name in ("position_m", "velocity_mps", "heading_rad", "valid", "size_m"):
        np.testing.assert_array_equal(getattr(one.tracks, name), getattr(two.tracks, name))


def test_what_comes_later_moves_nothing(tmp_path):
    tree = womd.tree()
    later = womd.tree()
    for track in later["tracks"]:
        for state in track["states"][11:]:
            if state is not None:
                state[0] += 0.3
                state[3] += 0.2
    (one,), (two,) = (scenes(womd.write(tmp_path / n, womd.scenario(t))) for n, t in (("a", tree), ("b", later)))
    for name in ("position_m", "size_m", "origin_m", "valid"):
        np.testing.assert_array_equal(
            getattr(one.history(10, 11).tracks, name), getattr(two.history(10, 11).tracks, name)
        )


def test_checksums():
    assert crc32c(b"123456789") == 0xE3069283  # the check value of CRC-32C (RFC 3720, appendix B.4, and others)
    assert crc32c(bytes(32)) == 0x8A9136AA  # RFC 3720, B.4: 32 bytes of zeros
    rng = np.random.default_rng(3)
    for n in (0, 1, 7, 8, 9, 1000):
        data = rng.bytes(n)
        assert crc32c(data) == proto_writer.crc32c(data)
        assert framed(data) == proto_writer.record(data)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda b: b[:-1], "truncated"),
        (lambda b: b[:6], "damaged length"),
        (lambda b: bytes([b[0] ^ 1]) + b[1:], "damaged length"),
        (lambda b: b[:40] + bytes([b[40] ^ 1]) + b[41:], "checksum differs"),
        (lambda b: b"", "is empty"),
    ],
)
def test_damaged_files_are_named(tmp_path, spoil, message):
    file = womd.write(tmp_path, womd.scenario(womd.tree()))
    file.write_bytes(spoil(file.read_bytes()))
    with pytest.raises(InputError, match=message) as error:
        list(scenes(file))
    assert str(file) in str(error.value)
    with pytest.raises(InputError):
        list(records(file))


def _changed(**changes):
    tree = womd.tree()
    for key, change in changes.items():
        tree[key] = change(tree[key])
    return womd.scenario(tree)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (_changed(times=lambda t: [x * 10 for x in t]), "apart, not 0.1 s"),
        (_changed(times=lambda t: [*t[:50], t[50] + 3.0, *t[51:]]), "apart, not 0.1 s"),
        (_changed(t0=lambda t: 200), "current time 200"),
        (_changed(predict=lambda p: [99]), "is not there"),
        (_changed(tracks=lambda t: [t[0], t[0]]), "two tracks have one id"),
        (b"\x0b\x0c", "no scenario"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, content, message):
    with pytest.raises(InputError, match=message):
        list(scenes(womd.write(tmp_path, content)))


@pytest.mark.parametrize("factor", [0.3048, 3.28084, 20.0])
def test_positions_in_other_units_are_refused(tmp_path, factor):
    tree = womd.tree()
    for track in tree["tracks"]:
        for state in track["states"]:
            if state is not None:
                state[0] *= factor
                state[1] *= factor
    with pytest.raises(InputError, match=r"other units|as fast as the velocities"):
        list(scenes(womd.write(tmp_path, womd.scenario(tree))))


def test_rows_that_cannot_be_are_dropped_and_counted(tmp_path):
    tree = womd.tree()
    tree["tracks"][0]["states"][50][0] = float("nan")
    tree["tracks"][1]["states"][50][7] = 500.0
    (scene,) = scenes(womd.write(tmp_path, womd.scenario(tree)))
    steps = World().steps
    assert dict(scene.counts) == {
        "rows_in": steps, "rows_out": steps - 2, "rows_dropped_unreadable": 1, "rows_dropped_implausible": 1,
    }  # fmt: skip


def test_a_real_scenario(shared_data):
    folder = shared_data / "womd" / "tfrecord"
    if not folder.is_dir():
        pytest.skip(f"no Waymo Open Motion at {folder}")
    (scene,) = scenes(folder)
    assert scene.tracks.valid.shape == (83, 91)
    assert scene.counts["rows_in"] == scene.counts["rows_out"] == 4596
    assert not scene.tracks.flagged(TrackFlag.IMPLAUSIBLE).any()
    assert len(scene.road.lanes) == 197
    stated = {(lane.lane_id, s) for lane in scene.road.lanes for s in lane.successors}
    by_ends = meeting({lane.lane_id: lane.centre_line_m for lane in scene.road.lanes})
    assert stated == {(a, b) for a, found in by_ends.items() for b in found}  # what the tf.Example reader relies on
    assert sum(lane.in_junction for lane in scene.road.lanes) > 20
    widths = np.array([lane.width_m for lane in scene.road.lanes])
    assert 3.0 < np.nanmedian(widths) < 4.0
    assert len(scene.signals.signal_id) == 12
    assert set(np.unique(scene.signals.state)) == {SignalState.UNKNOWN, SignalState.RED}
