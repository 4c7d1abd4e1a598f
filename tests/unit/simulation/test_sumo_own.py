"""The user's own networks: OpenStreetMap, OpenDRIVE and SUMO files, with generated and with given demand."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.simulation.generate import generate
from stylesim.simulation.sumo.episode import prepare_episode
from stylesim.simulation.sumo.own import own_network
from stylesim.simulation.sumo.roads import read_network
from stylesim.simulation.sumo.ways import WayFinder, generated_demand
from stylesim.tracks import AgentKind
from tests.unit.simulation.own_maps import OSM, write_net, write_osm, write_xodr

pytest.importorskip("libsumo", exc_type=ImportError)
SPECTRUM = Population.load("tdbm_spectrum")


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STYLESIM_CACHE", str(tmp_path / "cache"))


def own(source: Path, **options: object) -> str:
    return str(own_network(source, duration_s=15.0, warm_up_s=25.0, **options))  # type: ignore[arg-type]


@pytest.mark.parametrize("write", [write_osm, write_xodr, write_net])
def test_every_kind_of_map_is_driven_on_by_worker_processes(write: Callable[[Path], Path], tmp_path: Path) -> None:
    source = write(tmp_path)
    corpus = generate(own(source, vph=2400.0), SPECTRUM, episodes=2, seed=3, out=tmp_path / "corpus", workers=2)
    (described,) = corpus.manifest["configuration"]["scenarios"]
    assert described["options"]["own"]["sha256"] == hashlib.sha256(source.read_bytes()).hexdigest()
    for scene in corpus:
        assert scene.tracks.n_agents > 3
        assert scene.road is not None
        assert (scene.signals is not None) == (write is not write_xodr)
        assert all(style is not None for style in scene.tracks.driver)
    again = generate(own(source, vph=2400.0), SPECTRUM, episodes=2, seed=3, out=tmp_path / "again", workers=1)
    assert again.fingerprint == corpus.fingerprint


def test_sidewalks_are_no_lanes_and_lights_ask_drivers(tmp_path: Path) -> None:
    folder = Path(own(write_osm(tmp_path)))
    network = read_network(folder / "own.net.xml")
    assert {lane.width_m > 2.5 for lane in network.road.lanes} == {True}
    assert network.signals() == ("2",)
    right = [lane for lane in network.road.lanes if lane.stop_line_m is not None and not lane.right_neighbour]
    assert right


def test_demand_runs_between_all_pairs_of_the_fringe(tmp_path: Path) -> None:
    found = generated_demand(Path(own(write_net(tmp_path))) / "own.net.xml")
    assert {flow.enter for flow in found.flows} == {"west_in", "east_in", "south_in", "north_in"}
    assert sum(flow.share for flow in found.flows) == pytest.approx(1.0)
    for flow in found.flows:
        assert len(flow.to) == 3  # nobody turns round
        assert flow.enter.replace("_in", "_out") not in flow.to
    assert found.left_out == ""


def test_ways_are_the_shortest(tmp_path: Path) -> None:
    finder = WayFinder(read_network(write_net(tmp_path, "corridor")))
    before = finder.shortest("west_in")
    assert finder.way(before, "two_south_out") == ("west_in", "one_w", "one_two", "two_w", "two_south_out")
    assert "west_out" not in before


ROUTES = """<routes>
 <vType id="lorry" vClass="truck" length="9.5"/>
 <route id="through" edges="west_in east_out"/>
 <vehicle id="v1" depart="100" route="through"/>
 <vehicle id="v2" depart="0:01:45" type="lorry"><route edges="south_in north_out"/></vehicle>
 <trip id="t1" depart="103" from="east_in" to="south_out"/>
 <flow id="f" begin="100" end="160" number="6" from="north_in" to="west_out"/>
 <flow id="p" begin="100" end="400" vehsPerHour="360" from="west_in" to="east_out"/>
 <person id="walker" depart="100"><walk edges="west_in"/></person>
</routes>
"""


def test_vehicles_trips_and_flows_of_a_route_file_get_styled_drivers(tmp_path: Path) -> None:
    routes = tmp_path / "mine.rou.xml"
    routes.write_text(ROUTES)
    scenario = load_scenario(own(write_net(tmp_path), demand=routes))
    files = prepare_episode(scenario, SPECTRUM, seed=1, episode=0, folder=tmp_path)
    drivers = files.drivers
    until = 25.0 + 15.0 * 0.94
    assert {name for name in drivers if not name.startswith("p.")} == {"v1", "v2", "t1", "f.0", "f.1", "f.2", "f.3"}
    assert sorted(name for name in drivers if name.startswith("p.")) == ["p.0", "p.1", "p.2", "p.3"]
    assert max(driver.depart_s for driver in drivers.values()) < until
    assert drivers["v1"].depart_s == 0.0  # times count from the file's first departure
    assert drivers["v2"].depart_s == 5.0
    assert drivers["v2"].kind == AgentKind.TRUCK
    assert drivers["v2"].length_m == 9.5
    assert drivers["t1"].route == "east_in south_out"
    assert len({driver.style for driver in drivers.values()}) == len(drivers)
    other = prepare_episode(scenario, SPECTRUM, seed=1, episode=1, folder=tmp_path)
    assert other.drivers["v1"].style != drivers["v1"].style


@pytest.mark.parametrize(
    ("routes", "said"),
    [
        ("<routes/>", "no vehicle, trip or flow"),
        ("<routes><vehicle id='a' depart='0' route='r'/></routes>", "no route 'r'"),
        ("<routes><vehicle id='a' depart='triggered' route='r'/></routes>", "only numbers are understood"),
        ("<routes><trip id='a' depart='0' from='west_in' to='nowhere'/></routes>", "edge 'nowhere'"),
        ("<routes><trip id='a' depart='0' from='west_out' to='east_in'/></routes>", "no way leads"),
        ("<routes><trip id='a b' depart='0' from='west_in' to='east_out'/></routes>", "ids are"),
        ("<routes><flow id='a' from='west_in' to='east_out'/></routes>", "needs number"),
        ("<routes><vehicle", "damaged or no XML"),
        ("<net/>", "expected <routes>"),
        (
            "<!DOCTYPE routes [<!ENTITY a 'b'>]><routes><trip id='&a;' depart='0' from='x' to='y'/></routes>",
            "document type",
        ),
    ],
)
def test_a_route_file_that_cannot_be_used_is_named(routes: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.rou.xml"
    path.write_text(routes)

    def prepared() -> None:
        scenario = load_scenario(own(write_net(tmp_path), demand=path))
        prepare_episode(scenario, SPECTRUM, seed=1, episode=0, folder=tmp_path)

    with pytest.raises(InputError, match=said) as caught:
        prepared()
    assert "rou.xml" in str(caught.value)


HOSTILE = {
    "empty.net.xml": ("<net version='1.20'/>", "no lanes"),
    "cut.net.xml": ("<net version='1.20'><edge id='a'><lane id='a_0'", "damaged or no XML"),
    "nonsense.net.xml": ("<net><edge id='a' from='x' to='y'><lane id='a_0'/></edge></net>", "refuses|died"),
    "text.net.xml": ("hello", "no network"),
    "bomb.osm": ("<!DOCTYPE osm [<!ENTITY a 'b'>]><osm version='0.6'>&a;</osm>", "no network|document type"),
    "sea.osm": ("<osm version='0.6'><node id='1' lat='0' lon='0'/></osm>", "."),
    "empty.xodr": ("<OpenDRIVE><header/></OpenDRIVE>", "."),
    "walk.osm": (OSM.replace("primary", "footway").replace("secondary", "footway"), "."),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_map_that_cannot_be_used_is_named_and_leaves_nothing(name: str, tmp_path: Path) -> None:
    text, said = HOSTILE[name]
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        own(path)
    assert name in str(caught.value)
    assert not any((tmp_path / "cache" / "own").iterdir())


def test_options_are_checked_before_any_work(tmp_path: Path) -> None:
    net = write_net(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        own(tmp_path / "missing.net.xml")
    with pytest.raises(InputError, match="not both"):
        own(net, demand=net, vph=100.0)
    with pytest.raises(InputError, match="vph"):
        own(net, vph=-1.0)


def test_demand_is_as_high_as_asked_for(tmp_path: Path) -> None:
    scenario = load_scenario(own(write_net(tmp_path), vph=1000.0))
    drawn = [scenario.draw(np.random.default_rng(seed))["demand_vph"] for seed in range(50)]
    assert 700.0 <= min(drawn) < 1000.0 < max(drawn) <= 1300.0
