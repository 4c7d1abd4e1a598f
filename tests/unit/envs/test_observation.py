import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.envs.config import EnvConfig
from stylesim.envs.info import described
from stylesim.envs.observation import ROAD_COLUMNS, SIGNAL_COLUMNS, VEHICLE_COLUMNS, Layout
from stylesim.signals import SignalState
from tests.unit.envs.snapshots import made_snapshot

CONFIG = EnvConfig()
LAYOUT = Layout(3, 100.0, False)


def encoded(snapshot, layout=LAYOUT):
    return layout.encode(snapshot, layout.nearest(snapshot), CONFIG)


def test_neighbours_are_seen_from_the_ego_looking_ahead() -> None:
    north = made_snapshot([(100.0, 70.0, 0.0, 4.0, np.pi / 2)], heading_rad=np.pi / 2)
    row = dict(zip(VEHICLE_COLUMNS, LAYOUT.vehicles(encoded(north))[1], strict=True))
    assert row["presence"] == 1
    assert (row["x"], row["y"]) == (pytest.approx(0.2), pytest.approx(0.0, abs=1e-6))
    assert (row["vx"], row["vy"]) == (pytest.approx(-6 / 40), pytest.approx(0.0, abs=1e-6))
    assert (row["cos_h"], row["sin_h"]) == (pytest.approx(1.0), pytest.approx(0.0, abs=1e-6))


def test_left_is_positive() -> None:
    east = made_snapshot([(100.0, 53.5, 10.0, 0.0, 0.0)])
    assert LAYOUT.vehicles(encoded(east))[1][2] == pytest.approx(0.035)


def test_nearest_first_and_only_within_the_perception_range() -> None:
    snapshot = made_snapshot([(100.0 + d, 50.0, 0.0, 0.0, 0.0) for d in (90.0, 30.0, 130.0, -10.0)])
    assert LAYOUT.nearest(snapshot).tolist() == [4, 2, 1]


def test_missing_neighbours_are_rows_of_zeros() -> None:
    table = LAYOUT.vehicles(encoded(made_snapshot([])))
    assert not table[1:].any()
    assert table[0, 0] == 1


def test_signal_and_road() -> None:
    snapshot = made_snapshot(
        [], signal_state=float(SignalState.YELLOW), stop_line_m=40.0, since_onset_s=3.0, time_s=15.0
    )
    signal = dict(zip(SIGNAL_COLUMNS, LAYOUT.signal(encoded(snapshot)), strict=True))
    assert signal["signal_yellow"] == 1
    assert sum(signal[f"signal_{s.name.lower()}"] for s in SignalState) == 1
    assert signal["stop_line"] == pytest.approx(0.4)
    assert signal["since_onset"] == pytest.approx(0.1)
    road = dict(zip(ROAD_COLUMNS, LAYOUT.road(encoded(snapshot)), strict=True))
    assert road["time_left"] == pytest.approx(0.75)
    assert road["speed_limit"] == pytest.approx(15 / 40)


def test_style_is_seen_only_when_asked_for() -> None:
    snapshot = made_snapshot([(110.0, 50.0, 0.0, 0.0, 0.0)])
    open_layout = Layout(3, 100.0, True)
    assert not any("style" in name or "aggressiveness" in name for name in LAYOUT.names)
    row = dict(zip(open_layout.vehicle_columns, open_layout.vehicles(encoded(snapshot, open_layout))[1], strict=True))
    assert row["style_aggressive"] == 1
    assert row["aggressiveness"] == 1
    changed = snapshot.style.copy()
    changed[1] = 5
    other = type(snapshot)(**{**vars(snapshot), "style": changed})
    assert np.array_equal(encoded(snapshot), encoded(other))


def test_every_number_has_a_name() -> None:
    for layout in (LAYOUT, Layout(8, 50.0, True)):
        assert len(layout.names) == layout.space.shape[0] == len(set(layout.names))


numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(*[numbers] * 5), max_size=5), numbers, numbers)
def test_whatever_comes_the_observation_is_in_its_space(others, offset, distance) -> None:
    with np.errstate(all="ignore"):
        snapshot = made_snapshot(others, lane_offset_m=offset, stop_line_m=distance)
        assert LAYOUT.space.contains(encoded(snapshot))


def test_info_tells_the_truth_about_the_seen_neighbours() -> None:
    snapshot = made_snapshot([(110.0, 50.0, 0.0, 0.0, 0.0), (105.0, 50.0, 0.0, 0.0, 0.0)])
    neighbours = described(snapshot, LAYOUT.nearest(snapshot), 3)["neighbours"]
    assert neighbours["number"].tolist() == [2, 1, -1]
    assert neighbours["style"] == ("reckless", "aggressive", "")
    assert neighbours["decision"] == ("go", "stop", "")
    assert neighbours["ran_red"].tolist() == [False, True, False]
    assert neighbours["crashed"].tolist() == [True, False, False]
