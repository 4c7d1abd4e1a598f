import gzip
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from stylesim.datasets.dlr_ut import scenes
from stylesim.errors import InputError
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind
from tests.conftest import ROOT
from tests.formats import dlr_ut_files as dlr

SHIPPED = ROOT / "data" / "dlr_ut"
HEADER = ",".join(dlr.COLUMNS).encode() + b"\n"


def total(found: list[Scene]) -> Counter[str]:
    counts: Counter[str] = Counter()
    for scene in found:
        counts.update(scene.counts)
    return counts


def test_values_units_and_ids_are_read_exactly(tmp_path):
    dlr.write(tmp_path, dlr.rows(n_frames=100))
    (scene,) = scenes(tmp_path)
    tracks = scene.tracks
    assert tracks.agent_id == ("1695556712692966", "1695556712692967", "1695556712692968")
    assert tracks.dt_s == 0.1
    assert tracks.n_frames == 50
    assert tracks.valid.all()
    np.testing.assert_allclose(
        tracks.position_m[0, :, 0] + tracks.origin_m[0], dlr.ORIGIN[0] + np.arange(50), atol=1e-3
    )
    np.testing.assert_allclose(tracks.velocity_mps[0, 0], [10.0, 0.0])
    assert (tracks.kind == AgentKind.CAR).all()
    assert scene.unit_id == f"dlr_ut_{dlr.STAMP}"
    assert scene.road is None


def test_yaw_is_degrees_counter_clockwise_from_east(tmp_path):
    table = dlr.rows(n_frames=4)
    for row in table:
        row["yaw"] = -90.0
    dlr.write(tmp_path, table)
    (scene,) = scenes(tmp_path)
    np.testing.assert_allclose(scene.tracks.heading_rad, -np.pi / 2, atol=1e-6)


def test_kinds_need_a_sure_classifier(tmp_path):
    table = dlr.rows(n_agents=3, n_frames=4)
    for row in table:
        agent = int(str(row["id"])) - 1695556712692966
        shares = ({"car": 0.3, "van": 0.3, "truck": 0.4}, {"pedestrian": 0.39, "bicycle": 0.38}, {"truck": 0.8})[agent]
        row["classifications_car"] = 0.0
        row |= {f"classifications_{name}": share for name, share in shares.items()}
    dlr.write(tmp_path, table)
    (scene,) = scenes(tmp_path)
    assert scene.tracks.kind.tolist() == [AgentKind.CAR, AgentKind.OTHER, AgentKind.TRUCK]


def test_long_recordings_are_cut_and_agents_keep_their_ids(tmp_path):
    dlr.write(tmp_path, dlr.rows(n_frames=1000))
    found = list(scenes(tmp_path, scene_s=20.0))
    assert [s.tracks.n_frames for s in found] == [200, 200, 100]
    assert [s.start_s for s in found] == [0.0, 20.0, 40.0]
    assert len({s.unit_id for s in found}) == 1
    assert len({s.tracks.agent_id for s in found}) == 1


def test_files_that_join_are_one_unit_others_are_not(tmp_path):
    for stamp in ("230924-120000_230924-120100", "230924-120100_230924-120200", "230924-130000_230924-130100"):
        table = dlr.rows(n_frames=10)
        minute = stamp[9:11]
        for row in table:
            row["timestamp"] = str(row["timestamp"]).replace(" 12:00", f" {stamp[7:9]}:{minute}")
        dlr.write(tmp_path, table, stamp=stamp)
    found = list(scenes(tmp_path))
    assert [s.unit_id[-13:] for s in found] == ["230924-120100", "230924-120100", "230924-130100"]
    assert [s.start_s for s in found] == [0.0, 60.0, 0.0]


def test_lights_hold_the_earlier_log_and_go_stale(tmp_path):
    dlr.write(tmp_path, dlr.rows(n_frames=200))
    dlr.write_lights(tmp_path, [(1.0, 1, 3), (2.0, 1, 4), (3.0, 1, 5), (4.0, 1, 7), (5.0, 1, 9), (1.0, 10, 1)])
    (scene,) = scenes(tmp_path)
    assert scene.signals is not None
    assert scene.signals.signal_id == ("1", "10")
    state = scene.signals.state[0]
    assert state[9] == SignalState.UNKNOWN  # nothing logged yet
    assert state[10] == state[29] == SignalState.RED  # red and amber is red
    assert (state[30], state[39], state[40], state[50]) == (
        SignalState.GREEN, SignalState.GREEN, SignalState.YELLOW, SignalState.UNKNOWN,
    )  # fmt: skip
    assert scene.signals.state[1, 15] == SignalState.DARK
    assert scene.signals.state[0, 85] == SignalState.UNKNOWN


def test_interpolated_rows_are_hidden_until_the_next_detection(tmp_path):
    gap = tuple((0, frame) for frame in range(10, 21))  # next detection: frame 21, seen at 10 Hz from frame 11 on
    dlr.write(tmp_path, dlr.rows(n_frames=60, interpolated=gap))
    (scene,) = scenes(tmp_path)
    for t0, hidden in ((4, []), (5, [5]), (10, [5, 6, 7, 8, 9, 10]), (11, [])):
        valid = scene.history(t0, 50).tracks.valid[0]
        assert np.flatnonzero(~valid).tolist() == hidden
        assert scene.history(t0, 50).tracks.valid[1].all()


def test_bad_rows_are_dropped_and_counted(tmp_path):
    table = dlr.rows(n_frames=400)
    table[5]["timestamp"] = "yesterday"
    table[6]["center_easting"] = "nan"
    table[7]["velocity_easting"] = "x"
    table[8]["timestamp"] = "2099-01-01 00:00:00+00:00"
    table[9]["timestamp"] = "2023-09-24 12:00:00.163000+00:00"
    table[10]["center_northing"] = -5.0
    table.append(dict(table[20]))
    dlr.write(tmp_path, table)
    found = list(scenes(tmp_path))
    counts = total(found)
    assert counts["rows_dropped_unreadable"] == 3
    assert counts["rows_dropped_outside_recording"] == 1
    assert counts["rows_dropped_off_clock"] == 1
    assert counts["rows_dropped_implausible"] == 1
    assert counts["rows_dropped_duplicate"] == 1
    lost = sum(n for key, n in counts.items() if key.startswith("rows_dropped_"))
    assert counts["rows_in"] == len(table) == counts["rows_out"] + lost
    assert counts["rows_out"] == sum(int(s.tracks.valid.sum()) for s in found)


def _off_the_clock(table):
    for i, row in enumerate(table):
        row["timestamp"] = f"2023-09-24 12:00:0{i % 7}.{i * 613 % 1000:03}+00:00"


def _scaled(table, column, factor):
    for row in table:
        row[column] = float(row[column]) * factor


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda t: [row.update(center_easting=10.5, center_northing=52.3) for row in t], "no UTM metres"),
        (lambda t: _scaled(t, "velocity_easting", 3.6), "positions move 0.28 times"),
        (lambda t: [row.update(yaw=180.0) for row in t], "180 degrees off"),
        (lambda t: [row.update(timestamp="12:00") for row in t], "no usable row"),
        (_off_the_clock, "no clock of 20 Hz"),
    ],
)
def test_files_in_other_units_are_refused(tmp_path, spoil, says):
    table = dlr.rows(n_frames=100)
    spoil(table)
    path = dlr.write(tmp_path, table)
    with pytest.raises(InputError, match=says) as error:
        list(scenes(tmp_path))
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (gzip.compress(dlr.csv_text(dlr.rows()).encode())[:-400], "truncated gzip"),
        (b"not gzip at all", "damaged or truncated gzip"),
        (gzip.compress(b""), "lacks the columns"),
        (gzip.compress(b"timestamp,id\n1,2\n"), "lacks the columns center_easting"),
        (gzip.compress(HEADER), "no usable row"),
        (
            gzip.compress(",".join(dlr.COLUMNS).encode() + b"\n" + bytes(range(256)) * 20),
            "no readable CSV|no usable row",
        ),
    ],
    ids=["cut", "no gzip", "empty", "two columns", "no rows", "bytes"],
)
def test_damaged_files_are_named(tmp_path, content, says):
    path = tmp_path / f"trajectories_{dlr.STAMP}.csv.gz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=says) as error:
        list(scenes(tmp_path))
    assert str(path) in str(error.value)


def test_a_csv_that_ends_within_a_row_loses_that_row_only(tmp_path):
    text = dlr.csv_text(dlr.rows(n_frames=100))
    path = tmp_path / f"trajectories_{dlr.STAMP}.csv"
    path.write_text(text[:-40])
    found = list(scenes(path))
    assert total(found)["rows_in"] == 300
    assert total(found)["rows_dropped_unreadable"] == 1


def test_folders_without_recordings_are_named(tmp_path):
    with pytest.raises(InputError, match="holds no trajectories"):
        list(scenes(tmp_path))
    with pytest.raises(InputError, match="does not exist"):
        list(scenes(tmp_path / "nowhere"))


def test_the_shipped_recording():
    found = list(scenes(SHIPPED))
    counts = total(found)
    assert counts["rows_in"] == 90_851
    assert counts["rows_out"] == 45_453
    assert counts["tracks"] == 211
    assert len(found) == 15
    assert found[0].scenario == "braunschweig_intersection"
    assert found[0].road is not None
    assert found[0].road.source == "inferred"
    assert found[0].signals is not None
    assert found[0].signals.state.shape == (30, 200)


def _truncated(path: Path, out: Path, *, before: str) -> None:
    with gzip.open(path, "rt") as source:
        header, *lines = source.read().splitlines()
    kept = [line for line in lines if line.split(",", 1)[0] <= before]
    out.write_bytes(gzip.compress("\n".join([header, *kept, ""]).encode()))


def test_truncating_the_source_at_t0_changes_no_history(tmp_path):
    t0_s = 52.3  # in the third scene; several rows before it are interpolated
    end = "2023-09-24 12:00:52.316482+00:00"
    for file in SHIPPED.glob("*.csv.gz"):
        _truncated(file, tmp_path / file.name, before=end)
    frame = round((t0_s - 40.0) / 0.1)
    whole = next(s for s in scenes(SHIPPED) if s.start_s == 40.0).history(frame, 50)
    cut = list(scenes(tmp_path))[-1]
    assert cut.tracks.n_frames == frame + 1
    cut = cut.history(frame, 50)
    known = whole.tracks.select(whole.tracks.valid.any(axis=1))
    found = cut.tracks.select(cut.tracks.valid.any(axis=1))
    assert known.agent_id == found.agent_id
    for name in ("kind", "size_m", "position_m", "velocity_mps", "heading_rad", "valid", "origin_m"):
        np.testing.assert_array_equal(getattr(known, name), getattr(found, name))
    np.testing.assert_array_equal(whole.signals.state, cut.signals.state)
    for one, other in zip(whole.road.lanes, cut.road.lanes, strict=True):
        np.testing.assert_array_equal(one.centre_line_m, other.centre_line_m)


def test_links_of_lights_are_inferred_where_they_are_sure():
    scene = next(iter(scenes(SHIPPED, links="infer")))
    assert scene.signals is not None
    assert scene.road is not None
    linked = {i: lanes for i, lanes in zip(scene.signals.signal_id, scene.signals.lane_id, strict=True) if lanes}
    assert scene.counts["light_links_inferred"] == sum(map(len, linked.values())) >= 2
    assert scene.counts["light_links_inferred"] + scene.counts["light_links_unknown"] == 9
    assert all(int(i) <= 13 for i in linked), "lights 14 to 29 have no yellow: they are not for vehicles"
    assert {lane for lanes in linked.values() for lane in lanes} <= {lane.lane_id for lane in scene.road.lanes}
    without = next(iter(scenes(SHIPPED)))
    assert not any(without.signals.lane_id)
