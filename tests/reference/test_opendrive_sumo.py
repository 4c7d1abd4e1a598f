"""Our reading of OpenDRIVE against SUMO: a network of netgenerate, written as OpenDRIVE by netconvert, read by us."""

import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from stylesim.datasets.maps.opendrive import read_opendrive
from stylesim.geometry import project

sumo = pytest.importorskip("sumo", reason="eclipse-sumo is not installed")
BIN = Path(sumo.SUMO_HOME) / "bin"


def run(*command):
    subprocess.run([str(part) for part in command], check=True, capture_output=True, timeout=60)


@pytest.fixture(scope="module")
def net(tmp_path_factory):
    """A grid and a spider web with two lanes a direction: straight and curved roads, junctions."""
    folder = tmp_path_factory.mktemp("opendrive")
    found = {}
    for name, shape in (
        ("grid", ("--grid", "--grid.number", "2", "--grid.length", "90")),
        (
            "spider",
            ("--spider", "--spider.arm-number", "5", "--spider.circle-number", "1", "--spider.space-radius", "70"),
        ),
    ):
        own, foreign = folder / f"{name}.net.xml", folder / f"{name}.xodr"
        run(BIN / "netgenerate", *shape, "--default.lanenumber", "2", "--default.speed", "13.89", "-o", own)
        run(BIN / "netconvert", "-s", own, "--opendrive-output", foreign)
        found[name] = (ElementTree.parse(own).getroot(), read_opendrive(foreign, np.zeros(2)))
    return found


def shapes(root):
    """The centre lines of SUMO's lanes outside of junctions."""
    return {
        lane.get("id"): np.array([[float(v) for v in p.split(",")[:2]] for p in lane.get("shape").split()])
        for edge in root.findall("edge")
        if edge.get("function") != "internal"
        for lane in edge.findall("lane")
    }


def matched(root, road):
    """SUMO's lane id of each of our lanes outside of junctions: the one whose line both ends lie on, same direction."""
    found = {}
    for lane in road.lanes:
        if lane.in_junction:
            continue
        for name, line in shapes(root).items():
            ends = np.stack([lane.centre_line_m[0], lane.centre_line_m[-1]]).astype(float)
            along, _, distance, _ = project(ends, line)
            if distance.max() < 0.1 and along[1] > along[0]:
                found[lane.lane_id] = name
    return found


@pytest.mark.parametrize("name", ["grid", "spider"])
def test_lanes_lie_where_sumo_has_them(net, name):
    root, site = net[name]
    pairs = matched(root, site.road)
    assert sorted(pairs.values()) == sorted(shapes(root))  # each once
    for lane_id, other in pairs.items():
        lane = site.road.lane(lane_id)
        assert project(lane.centre_line_m.astype(float), shapes(root)[other])[2].max() < 0.05
        assert lane.width_m == pytest.approx(3.2, abs=0.01)
        assert lane.speed_limit_mps == pytest.approx(13.89)


@pytest.mark.parametrize("name", ["grid", "spider"])
def test_neighbours_and_connections_are_sumos(net, name):
    root, site = net[name]
    pairs = matched(root, site.road)
    ours = {
        (pairs[lane.lane_id], pairs[after])
        for lane in site.road.lanes
        if lane.lane_id in pairs
        for through in lane.successors
        for after in site.road.lane(through).successors
    }
    theirs = {
        (f"{c.get('from')}_{c.get('fromLane')}", f"{c.get('to')}_{c.get('toLane')}")
        for c in root.findall("connection")
        if not c.get("from").startswith(":")
    }
    assert len(theirs) > 10
    assert ours == theirs
    for lane_id, other in pairs.items():
        lane = site.road.lane(lane_id)
        edge, index = other.rsplit("_", 1)
        left, right = f"{edge}_{int(index) + 1}", f"{edge}_{int(index) - 1}"
        assert pairs.get(lane.left_neighbour, "") == (left if left in shapes(root) else "")
        assert pairs.get(lane.right_neighbour, "") == (right if right in shapes(root) else "")


def test_lanes_join_without_a_gap(net):
    """In the grid; netconvert's own reference lines turn by 27 degrees at once where roads of the spider meet."""
    _, site = net["grid"]
    for lane in site.road.lanes:
        for after in lane.successors:
            gap = np.hypot(*(lane.centre_line_m[-1] - site.road.lane(after).centre_line_m[0]))
            assert gap < 0.3, (lane.lane_id, after)
