from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.special import fresnel

from stylesim.datasets.maps.opendrive import read_opendrive
from stylesim.datasets.maps.opendrive_curves import Plan
from stylesim.errors import InputError

WIDTH = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'


def lane(number, *, kind="driving", width=WIDTH, links="", extra=""):
    return f'<lane id="{number}" type="{kind}"><link>{links}</link>{width}{extra}</lane>'


def section(s, *, left=(), right=()):
    return (
        f'<laneSection s="{s}"><left>{"".join(left)}</left><center><lane id="0" type="none"/></center>'
        f"<right>{''.join(right)}</right></laneSection>"
    )


def geometry(shape, *, s=0.0, x=0.0, y=0.0, hdg=0.0, length=100.0):
    return f'<geometry s="{s}" x="{x}" y="{y}" hdg="{hdg}" length="{length}">{shape}</geometry>'


def road(road_id, plan, sections, *, length=100.0, junction="-1", rule="RHT", link="", more="", offset="", signals=""):
    return (
        f'<road id="{road_id}" length="{length}" junction="{junction}" rule="{rule}"><link>{link}</link>{more}'
        f"<planView>{plan}</planView><lanes>{offset}{sections}</lanes><signals>{signals}</signals></road>"
    )


def read(tmp_path, *roads, header="", origin=(0.0, 0.0), **options):
    path = tmp_path / "map.xodr"
    path.write_text(f"<OpenDRIVE><header>{header}</header>{''.join(roads)}</OpenDRIVE>")
    site = read_opendrive(path, np.array(origin), **options)
    return {one.lane_id: one for one in site.road.lanes}, site


def at(shape, s, length=100.0, **options):
    plan = Plan.of(
        ElementTree.fromstring(f"<road><planView>{geometry(shape, length=length, **options)}</planView></road>")
    )
    return plan.at(np.asarray(s, float))


def test_line_and_arc():
    place, direction = at("<line/>", [0, 40], x=1.0, y=2.0, hdg=np.pi / 2)
    np.testing.assert_allclose(place, [[1, 2], [1, 42]], atol=1e-9)
    np.testing.assert_allclose(direction, np.pi / 2)
    s = np.linspace(0, 60, 61)
    place, direction = at('<arc curvature="0.05"/>', s)
    np.testing.assert_allclose(place, 20 * np.stack([np.sin(s / 20), 1 - np.cos(s / 20)], axis=1), atol=1e-8)
    np.testing.assert_allclose(direction, s / 20)


def test_spiral_is_the_fresnel_integral():
    """Curvature from 0 to c over L: x = A C(s/A), y = A S(s/A), A = sqrt(pi L / c)."""
    length, last = 80.0, 0.04
    s = np.linspace(0, length, 33)
    place, direction = at(f'<spiral curvStart="0" curvEnd="{last}"/>', s, length=length)
    a = np.sqrt(np.pi * length / last)
    sine, cosine = fresnel(s / a)
    np.testing.assert_allclose(place, a * np.stack([cosine, sine], axis=1), atol=1e-7)
    np.testing.assert_allclose(direction, last / length * s**2 / 2)
    # A spiral without change is an arc; one that unwinds ends straight.
    same, _ = at('<spiral curvStart="0.03" curvEnd="0.03"/>', s, length=length)
    arc, _ = at('<arc curvature="0.03"/>', s, length=length)
    np.testing.assert_allclose(same, arc, atol=1e-8)


def test_cubics():
    t = np.linspace(0, 1, 11)
    shape = '<paramPoly3 aU="0" bU="50" cU="0" dU="-5" aV="0" bV="0" cV="20" dV="0" pRange="{}"/>'
    place, direction = at(shape.format("normalized"), 60 * t, length=60.0)
    np.testing.assert_allclose(place, np.stack([50 * t - 5 * t**3, 20 * t**2], axis=1), atol=1e-9)
    np.testing.assert_allclose(np.tan(direction), 40 * t / (50 - 15 * t**2))
    place, _ = at(shape.format("arcLength"), t, length=60.0)
    np.testing.assert_allclose(place, np.stack([50 * t - 5 * t**3, 20 * t**2], axis=1), atol=1e-9)
    place, direction = at('<poly3 a="0" b="0" c="0.01" d="0"/>', [0, 10, 30], length=40.0)
    np.testing.assert_allclose(place[:, 1], 0.01 * place[:, 0] ** 2, atol=1e-9)
    gone = [
        float(np.sum(np.hypot(np.diff(u), np.diff(0.01 * u**2))))
        for u in (np.linspace(0, e, 2000) for e in place[:, 0])
    ]
    np.testing.assert_allclose(gone, [0, 10, 30], atol=1e-2)


def test_lanes_of_both_sides_in_driving_direction(tmp_path):
    lanes, _ = read(
        tmp_path,
        road(
            "7", geometry("<line/>"), section(0, left=[lane(1), lane(2, kind="sidewalk")], right=[lane(-1), lane(-2)])
        ),
        origin=(10.0, 5.0),
    )
    assert sorted(lanes) == ["7_0_-1", "7_0_-2", "7_0_1"]
    np.testing.assert_allclose(lanes["7_0_-2"].centre_line_m[[0, -1]], [[-10, -10.25], [90, -10.25]], atol=1e-4)
    np.testing.assert_allclose(lanes["7_0_1"].centre_line_m[[0, -1]], [[90, -3.25], [-10, -3.25]], atol=1e-4)
    np.testing.assert_allclose(lanes["7_0_1"].left_boundary_m[:, 1], -5.0, atol=1e-4)
    np.testing.assert_allclose(lanes["7_0_-1"].left_boundary_m[:, 1], -5.0, atol=1e-4)
    assert lanes["7_0_-1"].width_m == 3.5
    assert (lanes["7_0_-1"].left_neighbour, lanes["7_0_-1"].right_neighbour) == ("", "7_0_-2")
    assert lanes["7_0_-2"].left_neighbour == "7_0_-1"


def test_left_hand_traffic_turns_everything_round(tmp_path):
    lanes, _ = read(tmp_path, road("7", geometry("<line/>"), section(0, right=[lane(-1), lane(-2)]), rule="LHT"))
    one = lanes["7_0_-1"]
    assert one.centre_line_m[0, 0] > one.centre_line_m[-1, 0]
    np.testing.assert_allclose(one.left_boundary_m[:, 1], -3.5, atol=1e-4)
    assert (one.left_neighbour, one.right_neighbour) == ("7_0_-2", "")


def test_widths_offsets_and_borders(tmp_path):
    widening = '<width sOffset="0" a="3" b="0" c="0" d="0"/><width sOffset="50" a="3" b="0.02" c="0" d="0"/>'
    border = '<border sOffset="0" a="-7" b="0" c="0" d="0"/>'
    lanes, _ = read(
        tmp_path,
        road(
            "7",
            geometry("<line/>"),
            section(0, right=[lane(-1, width=widening), lane(-2, width=border)]),
            offset='<laneOffset s="0" a="1" b="0" c="0" d="0"/>',
        ),
    )
    one, two = lanes["7_0_-1"], lanes["7_0_-2"]
    np.testing.assert_allclose(one.left_boundary_m[:, 1], 1.0, atol=1e-5)
    np.testing.assert_allclose(one.right_boundary_m[[0, 50, -1], 1], [-2, -2, -3], atol=1e-4)
    np.testing.assert_allclose(two.left_boundary_m[-1, 1], -3, atol=1e-4)
    np.testing.assert_allclose(two.right_boundary_m[:, 1], -6, atol=1e-4)


def test_limits(tmp_path):
    lanes, _ = read(
        tmp_path,
        road(
            "7",
            geometry("<line/>"),
            section(0, right=[lane(-1), lane(-2, extra='<speed sOffset="0" max="30" unit="mph"/>')])
            + section(60, right=[lane(-1), lane(-2, extra='<speed sOffset="0" max="no limit"/>')]),
            more='<type s="0" type="town"><speed max="50" unit="km/h"/></type><type s="60" type="rural"/>',
        ),
    )
    found = {i: one.speed_limit_mps for i, one in lanes.items()}
    assert found["7_0_-1"] == pytest.approx(50 / 3.6)
    assert found["7_0_-2"] == pytest.approx(13.411, abs=1e-3)
    assert np.isnan([found["7_1_-1"], found["7_1_-2"]]).all()


def test_lanes_follow_over_sections_and_roads(tmp_path):
    to = '<successor id="-1"/>'
    first = road(
        "1",
        geometry("<line/>"),
        section(0, right=[lane(-1, links=to)]) + section(40, right=[lane(-1, links=to), lane(-2)]),
        link='<successor elementType="road" elementId="2" contactPoint="start"/>',
    )
    back = road(
        "2",
        geometry("<line/>", x=100.0),
        section(0, left=[lane(1, links='<predecessor id="1"/>')], right=[lane(-1)]),
        link='<predecessor elementType="road" elementId="1" contactPoint="end"/>',
    )
    lanes, _ = read(tmp_path, first, back)
    assert lanes["1_0_-1"].successors == ("1_1_-1",)
    assert lanes["1_1_-1"].successors == ("2_0_-1",)
    assert lanes["2_0_1"].successors == ()  # road 1 has no lane on its left


def test_lights_and_stop_lines(tmp_path):
    signals = (
        '<signal id="9" name="K1" s="80" dynamic="yes" type="1000001" orientation="+"/>'
        '<signal id="8" s="90" dynamic="no" type="294" orientation="+"><validity fromLane="-2" toLane="-2"/></signal>'
    )
    lanes, site = read(
        tmp_path,
        road("7", geometry("<line/>"), section(0, left=[lane(1)], right=[lane(-1), lane(-2)]), signals=signals),
    )
    (light,) = site.lights
    assert (light.light_id, light.name, light.lane_id) == ("9", "K1", ("7_0_-1", "7_0_-2"))
    np.testing.assert_allclose(lanes["7_0_-2"].stop_line_m, [[90, -3.5], [90, -7]], atol=1e-4)
    assert lanes["7_0_-1"].stop_line_m is None


def test_a_countrys_grid_is_brought_to_the_recordings_frame(tmp_path):
    grid = road("7", geometry("<line/>", x=293500.0, y=5629000.0), section(0, right=[lane(-1)]))
    lanes, _ = read(tmp_path, grid, utm_origin_m=np.array([293400.0, 5629000.0]))
    np.testing.assert_allclose(lanes["7_0_-1"].centre_line_m[0], [100, -1.75], atol=1e-3)
    local = road("7", geometry("<line/>", x=100.0), section(0, right=[lane(-1)]))
    offset = '<offset x="293400" y="5629000" z="0" hdg="0"/>'
    lanes, _ = read(tmp_path, local, header=offset, utm_origin_m=np.array([293400.0, 5629000.0]))
    np.testing.assert_allclose(lanes["7_0_-1"].centre_line_m[0], [100, -1.75], atol=1e-3)
    lanes, _ = read(tmp_path, local, utm_origin_m=np.array([293400.0, 5629000.0]))
    np.testing.assert_allclose(lanes["7_0_-1"].centre_line_m[0], [100, -1.75], atol=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("<line/>", "", "no shape"),
        ("<line/>", "<loop/>", "unknown shape 'loop'"),
        ("<line/>", '<arc curvature="nan"/>', "no usable number 'curvature'"),
        ('hdg="0.0"', 'hdg="east"', "road '7'"),
        ('length="100.0" junction', 'length="1e9" junction', "its length is"),
        ('a="3.5"', 'a="inf"', "no usable number 'a'"),
        ('type="driving"', 'type="tram"', "no lane for motor traffic"),
        ('id="-1"', 'id="x"', "road '7'"),
        ("<OpenDRIVE>", "<!DOCTYPE x><OpenDRIVE>", "document type"),
    ],
)
def test_damaged_maps_are_named(tmp_path, old, new, says):
    path = tmp_path / "map.xodr"
    text = f"<OpenDRIVE>{road('7', geometry('<line/>'), section(0, right=[lane(-1)]))}</OpenDRIVE>"
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=says) as error:
        read_opendrive(path, np.zeros(2))
    assert str(path) in str(error.value)
