import numpy as np
import pytest

from stylesim.datasets.inferred_road import MIN_TRACKS, infer_road, lane_share
from stylesim.datasets.recording import Recording
from stylesim.datasets.site_roads import SiteRoad, load_site_road, save_site_road, site_road_at
from stylesim.errors import InputError

ORIGIN = np.array([100.0, 200.0])


def recording(lines: list[np.ndarray], *, seed: int = 0, spread_m: float = 0.2) -> Recording:
    """One car per line at 10 m/s and 20 Hz, each with an offset of its own to the side."""
    rng = np.random.default_rng(seed)
    agent, frame, position = [], [], []
    for number, line in enumerate(lines):
        s = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
        at = np.arange(0, s[-1], 0.5)
        xy = np.stack([np.interp(at, s, line[:, 0]), np.interp(at, s, line[:, 1])], axis=1)
        angle = np.unwrap(np.arctan2(*np.gradient(xy, axis=0).T[::-1]))
        offset = rng.normal(0, spread_m)
        position.append(xy + offset * np.stack([-np.sin(angle), np.cos(angle)], axis=1) + ORIGIN)
        agent.append(np.full(len(at), number))
        frame.append(np.arange(len(at)))
    agent, frame, position = np.concatenate(agent), np.concatenate(frame), np.concatenate(position)
    n, rows = len(lines), len(agent)
    velocity = np.gradient(position, axis=0) / 0.05
    return Recording(
        recording_id="made", agent_id=tuple(f"a{i:02d}" for i in range(n)), kind=np.ones(n, np.int8),
        size_m=np.ones((n, 2), np.float32), agent=agent.astype(np.int64), frame=frame.astype(np.int64),
        position_m=position, velocity_mps=velocity, heading_rad=np.arctan2(velocity[:, 1], velocity[:, 0]),
        lookahead=np.zeros(rows, np.int64), dt_s=0.05,
    )  # fmt: skip


def straight(y: float) -> np.ndarray:
    return np.stack([np.linspace(0, 100, 101), np.full(101, y)], axis=1)


def left_turn() -> np.ndarray:
    angle = np.linspace(-np.pi / 2, 0, 40)
    bend = np.array([60.0, 15.0]) + 15.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([straight(0.0)[:60], bend, np.stack([np.full(40, 75.0), np.linspace(16, 55, 40)], axis=1)])


def test_parallel_lanes_are_told_apart_and_know_each_other():
    road = infer_road(recording([straight(0.0)] * 6 + [straight(3.2)] * 6), ORIGIN)
    assert road is not None
    assert road.source == "inferred"
    low, high = sorted(road.lanes, key=lambda lane: lane.centre_line_m[0, 1])
    assert np.abs(low.centre_line_m[:, 1]).max() < 0.25
    assert np.abs(high.centre_line_m[:, 1] - 3.2).max() < 0.25
    assert (low.left_neighbour, low.right_neighbour) == (high.lane_id, "")
    assert (high.left_neighbour, high.right_neighbour) == ("", low.lane_id)
    assert low.evidence is not None
    assert set(low.evidence.track_id) == {f"a{i:02d}" for i in range(6)}


def test_a_turn_and_a_straight_on_share_their_approach():
    road = infer_road(recording([straight(0.0)] * 8 + [left_turn()] * 6, spread_m=0.1), ORIGIN)
    assert road is not None
    approach = next(lane for lane in road.lanes if lane.centre_line_m[0, 0] < 5.0)
    assert len([lane for lane in road.lanes if lane.centre_line_m[0, 0] < 5.0]) == 1
    assert approach.evidence is not None
    assert len(approach.evidence.track_id) == 14
    assert len(approach.successors) == 2
    for name in approach.successors:
        gap = road.lane(name).centre_line_m[0] - approach.centre_line_m[-1]
        assert np.hypot(*gap) < 2.5


def test_too_few_tracks_are_no_lane():
    assert infer_road(recording([straight(0.0)] * (MIN_TRACKS - 1)), ORIGIN) is None
    assert infer_road(recording([straight(0.0)] * MIN_TRACKS), ORIGIN) is not None


def test_tracks_all_over_the_place_are_no_lane():
    assert infer_road(recording([straight(1.2 * i) for i in range(8)], spread_m=0.0), ORIGIN) is None


def test_a_driver_is_left_out_of_its_own_centre():
    lines = [straight(0.0)] * 5
    made = recording(lines, spread_m=0.0)
    position = made.position_m.copy()
    position[made.agent == 4] += [0.0, 1.0]
    position[made.agent == 3] += [0.0, 0.4]
    made = Recording(**{**made.__dict__, "position_m": position})
    road = infer_road(made, ORIGIN)
    assert road is not None
    (lane,) = road.lanes
    middle = slice(20, 80)
    np.testing.assert_allclose(lane.centre_line_m[middle, 1], 0.0, atol=0.02)
    # Without a00 the others are at 0, 0, 0.4 and 1: the median moves to 0.2.
    np.testing.assert_allclose(lane.without("a00").centre_line_m[middle, 1], 0.2, atol=0.02)
    np.testing.assert_allclose(lane.without("a04").centre_line_m[middle, 1], 0.0, atol=0.02)


def test_lane_share_counts_direction():
    made = recording([straight(0.0)] * 5, spread_m=0.0)
    road = infer_road(made, ORIGIN)
    assert road is not None
    assert lane_share(road, made, ORIGIN) > 0.98  # all but the last row of each car, whose heading is made up
    turned = Recording(**{**made.__dict__, "heading_rad": made.heading_rad + np.pi})
    assert lane_share(road, turned, ORIGIN) < 0.02


def test_a_site_road_survives_its_file(tmp_path):
    road = infer_road(recording([straight(0.0)] * 6 + [straight(3.2)] * 6), ORIGIN)
    assert road is not None
    save_site_road(SiteRoad("site", road, ORIGIN, {"why": "test"}), tmp_path / "a.json")
    site = load_site_road(tmp_path / "a.json")
    save_site_road(site, tmp_path / "b.json")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    for one, other in zip(road.lanes, site.road.lanes, strict=True):
        np.testing.assert_allclose(one.centre_line_m, other.centre_line_m, atol=6e-4)
        assert one.evidence is not None
        assert other.evidence is not None
        assert one.evidence.track_id == other.evidence.track_id
        np.testing.assert_allclose(one.evidence.offset_m, other.evidence.offset_m, atol=6e-4)
    assert site.holds(ORIGIN)
    assert not site.holds(ORIGIN + 500.0)


@pytest.mark.parametrize("text", ["", "{}", '{"format": "other", "version": 1}', "[1]"])
def test_other_files_are_no_site_road(tmp_path, text):
    (tmp_path / "road.json").write_text(text)
    with pytest.raises(InputError, match="road"):
        load_site_road(tmp_path / "road.json")
    with pytest.raises(InputError, match="cannot read the road"):
        load_site_road(tmp_path / "nowhere.json")


def test_the_shipped_site_is_found_by_place_and_names_its_drivers():
    site = site_road_at("dlr_ut", np.array([604780.0, 5792800.0]))
    assert site is not None
    assert len(site.road.lanes) > 20
    assert all(lane.evidence is not None and len(lane.evidence.track_id) >= MIN_TRACKS for lane in site.road.lanes)
    assert site.provenance["motor_rows_within_2_m_of_a_lane"] > 0.9
    assert site_road_at("dlr_ut", np.array([616517.0, 5793321.0])) is None  # the motorway of DLR HT
    assert site_road_at("av2", np.array([604780.0, 5792800.0])) is None
