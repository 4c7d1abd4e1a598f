import numpy as np
import pytest

from stylesim.datasets.maps.lanelet2 import read_lanelet2
from stylesim.datasets.maps.projection import from_origin
from stylesim.errors import InputError
from tests.formats import lanelet2_files

ORIGIN = np.array([100.0, -100.0])


@pytest.fixture
def made(tmp_path):
    return read_lanelet2(lanelet2_files.write(tmp_path / "map.osm"), from_origin(0.0, 0.0), ORIGIN)


def lanes(site):
    return {lane.lane_id: lane for lane in site.road.lanes}


def test_lanes_lie_where_the_map_says(made):
    found = lanes(made)
    assert sorted(found) == ["1001", "1002", "1003", "1004", "1005"]  # no walkway
    one = found["1001"]
    np.testing.assert_allclose(one.centre_line_m[0] + ORIGIN, [-100, 0], atol=1.0)
    np.testing.assert_allclose(one.centre_line_m[-1] + ORIGIN, [20, 0], atol=1.0)
    assert one.width_m == pytest.approx(3.5, abs=0.03)
    assert one.left_boundary_m[:, 1].mean() > one.right_boundary_m[:, 1].mean()
    south = found["1005"].centre_line_m
    assert south[0, 1] > south[-1, 1]


def test_what_follows_and_lies_beside(made):
    found = lanes(made)
    assert {i: lane.successors for i, lane in found.items()} == {
        "1001": ("1003",), "1002": ("1004",), "1003": (), "1004": (), "1005": (),
    }  # fmt: skip
    assert (found["1001"].left_neighbour, found["1001"].right_neighbour) == ("1002", "")
    assert (found["1004"].left_neighbour, found["1004"].right_neighbour) == ("", "1003")
    assert [i for i, lane in found.items() if lane.in_junction] == ["1003", "1004", "1005"]


def test_rules(made):
    found = lanes(made)
    assert found["1001"].speed_limit_mps == pytest.approx(50 / 3.6)
    assert found["1004"].speed_limit_mps == pytest.approx(30 / 3.6)
    np.testing.assert_allclose(found["1002"].stop_line_m + ORIGIN, [[18, -1.75], [18, 5.25]], atol=0.3)
    assert found["1003"].stop_line_m is None
    (light,) = made.lights
    assert (light.light_id, light.name, light.lane_id) == ("110", "Traffic light 2", ("1001", "1002"))
    assert made.light_lanes(("Traffic light 2", "110", "9")) == (("1001", "1002"), ("1001", "1002"), ())


def test_lanes_for_both_directions_are_two(tmp_path):
    path = lanelet2_files.write(tmp_path / "map.osm")
    text = path.read_text()
    at = text.index("<relation id='1005'")
    path.write_text(text[:at] + text[at:].replace("v='yes'", "v='no'", 1))
    found = lanes(read_lanelet2(path, from_origin(0.0, 0.0), ORIGIN))
    np.testing.assert_allclose(found["1005/reverse"].centre_line_m, found["1005"].centre_line_m[::-1], atol=1e-3)
    assert found["1005/reverse"].successors == ()


def test_incomplete_lanelets_are_counted(tmp_path):
    path = lanelet2_files.write(tmp_path / "map.osm")
    path.write_text(path.read_text().replace("<nd ref='12' />", "<nd ref='999' />"))
    site = read_lanelet2(path, from_origin(0.0, 0.0), ORIGIN)
    assert "1005" not in lanes(site)
    assert dict(site.notes) == {"map_ways_incomplete": 1, "map_lanes_incomplete": 1}


def test_deleted_elements_are_not_there(tmp_path):
    path = lanelet2_files.write(tmp_path / "map.osm")
    path.write_text(path.read_text().replace("<relation id='1005'", "<relation action='delete' id='1005'"))
    assert "1005" not in lanes(read_lanelet2(path, from_origin(0.0, 0.0), ORIGIN))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("v='lanelet'", "v='other'", "no lanelet2 map"),
        ("v='road'", "v='stairs'", None),
        ("lat='", "lat='x", "damaged map"),
        ("lon='", "lon='9e9' x='", "no place on Earth"),
        ("<osm", "<html", "damaged or no XML"),
    ],
)
def test_other_maps_are_named(tmp_path, old, new, says):
    path = lanelet2_files.write(tmp_path / "map.osm")
    path.write_text(path.read_text().replace(old, new))
    if says is None:
        assert list(lanes(read_lanelet2(path, from_origin(0.0, 0.0), ORIGIN))) == ["1002"]
        return
    with pytest.raises(InputError, match=says) as error:
        read_lanelet2(path, from_origin(0.0, 0.0), ORIGIN)
    assert str(path) in str(error.value)


def test_real_maps(shared_data):
    """Counts by hand from the files: lanelets for motor traffic, limits, stop lines, lights."""
    expected = {
        "interaction/DR_USA_Intersection_EP0.osm": (59, 6.7056, 0),
        "sind/map_relink_law_save.osm": (62, np.nan, 4),
        "taf_bw/k729_2022-03-16.osm": (32, np.nan, 0),
    }
    seen = 0
    for name, (count, limit, lights) in expected.items():
        if not (shared_data / name).is_file():
            continue
        seen += 1
        site = read_lanelet2(shared_data / name, from_origin(0.0, 0.0), np.zeros(2))
        assert len(site.road.lanes) == count
        assert site.road.lanes[0].speed_limit_mps == pytest.approx(limit, nan_ok=True)
        assert len(site.lights) == lights
        assert all(light.lane_id for light in site.lights)
        followed = {i for lane in site.road.lanes for i in lane.successors}
        gaps = [
            np.hypot(*(lane.centre_line_m[-1] - site.road.lane(after).centre_line_m[0]))
            for lane in site.road.lanes
            for after in lane.successors
        ]
        assert len(followed) > count / 3
        assert max(gaps) < 0.01  # one lane ends exactly where the next begins
    if not seen:
        pytest.skip(f"no lanelet2 maps at {shared_data}")
