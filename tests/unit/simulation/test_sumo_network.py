"""Compiling and reading networks, and strict options."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from stylesim.errors import InputError, SimulationError
from stylesim.population import Population
from stylesim.scenario import Scenario, load_scenario, scenarios
from stylesim.simulation.sumo.episode import prepare_episode
from stylesim.simulation.sumo.network import compiled_network
from stylesim.simulation.sumo.options import sumo_options_of
from stylesim.simulation.sumo.roads import read_network

pytest.importorskip("libsumo", exc_type=ImportError)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STYLESIM_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def changed(tmp_path: Path) -> Callable[[Callable[[dict], None]], Scenario]:
    """The yellow light in a folder of its own, with its YAML changed."""

    def make(change: Callable[[dict], None] = lambda raw: None) -> Scenario:
        folder = tmp_path / "changed"
        shutil.copytree(load_scenario("yellow_light").folder, folder)
        path = folder / "scenario.yaml"
        raw = yaml.safe_load(path.read_text())
        change(raw)
        path.write_text(yaml.safe_dump(raw))
        return load_scenario(str(folder))

    return make


def compiled(scenario: Scenario, limit_mps: float = 15.0) -> Path:
    return compiled_network(scenario, sumo_options_of(scenario), speed_limit_mps=limit_mps)


def test_cache_is_keyed_by_content_and_holds_whole_files_only(tmp_path: Path, changed) -> None:
    scenario = changed()
    first = compiled(scenario)
    stamp = first.stat().st_mtime_ns
    assert compiled(scenario) == first
    assert first.stat().st_mtime_ns == stamp
    assert compiled(scenario, 20.0) != first
    nodes = scenario.folder / "yellow_light.nod.xml"
    nodes.write_text(nodes.read_text().replace('x="1210"', 'x="1220"'))
    assert compiled(scenario) not in (first, None)
    assert {path.suffixes[-1] for path in (tmp_path / "cache" / "nets").iterdir()} == {".xml"}


def test_road_of_the_yellow_light() -> None:
    network = read_network(compiled(load_scenario("yellow_light"), 16.0))
    lanes = {lane.lane_id: lane for lane in network.road.lanes}
    right = lanes["west_in_0"]
    assert (right.left_neighbour, right.right_neighbour, right.width_m) == ("west_in_1", "", 3.5)
    assert right.speed_limit_mps == pytest.approx(16.0)
    assert lanes["south_in_0"].speed_limit_mps == pytest.approx(13.89, abs=0.01)
    assert right.stop_line_m is not None
    np.testing.assert_allclose(right.stop_line_m.mean(axis=0), right.centre_line_m[-1], atol=1e-4)
    assert np.hypot(*(right.stop_line_m[1] - right.stop_line_m[0])) == pytest.approx(3.5, abs=1e-4)
    assert all(lanes[name].in_junction for name in right.successors)
    ends = {after for name in right.successors for after in lanes[name].successors}
    assert ends == {"east_out_0", "south_out_0"}
    assert network.controlled_lanes() == tuple(
        f"{arm}_in_{index}" for arm, n in (("east", 2), ("north", 1), ("south", 1), ("west", 2)) for index in range(n)
    )


@pytest.mark.parametrize("broken", ["<nodes><node", '<nodes><node id="a" x="0" y="0"/></nodes>', "<nodes/>"])
def test_sources_that_cannot_be_compiled_give_netconvert_s_words(broken: str, changed) -> None:
    scenario = changed()
    (scenario.folder / "yellow_light.nod.xml").write_text(broken)
    with pytest.raises(SimulationError, match="netconvert could not compile"):
        compiled(scenario)


def test_a_network_without_edges_is_refused(changed) -> None:
    scenario = changed()
    (scenario.folder / "yellow_light.edg.xml").write_text("<edges/>")
    (scenario.folder / "yellow_light.con.xml").write_text("<connections/>")
    with pytest.raises(SimulationError, match="yellow_light"):
        compiled(scenario)


def misspell_flow(raw: dict) -> None:
    raw["options"]["flows"][0]["shares"] = raw["options"]["flows"][0].pop("share")


def drop_yellow(raw: dict) -> None:
    del raw["parameters"]["yellow_s"]


def add_parameter(raw: dict) -> None:
    raw["parameters"]["demand_vhp"] = raw["parameters"]["demand_vph"]


def heavy_shares(raw: dict) -> None:
    raw["options"]["flows"][0]["share"] = 0.9


def lose_file(raw: dict) -> None:
    raw["options"]["network"]["nodes"] = "nowhere.nod.xml"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (misspell_flow, "did you mean 'share'"),
        (drop_yellow, "'yellow_s' is missing"),
        (add_parameter, "Did you mean 'demand_vph'"),
        (heavy_shares, "sum to"),
        (lose_file, "no such file"),
    ],
)
def test_options_are_strict(change: Callable[[dict], None], said: str, changed, tmp_path: Path) -> None:
    scenario = changed(change)
    with pytest.raises(InputError, match=said):
        prepare_episode(scenario, Population.load("tdbm_spectrum"), seed=0, episode=0, folder=tmp_path)


def test_a_flow_over_an_unknown_edge_is_named(changed, tmp_path: Path) -> None:
    def change(raw: dict) -> None:
        raw["options"]["flows"][0]["enter"] = "west_inn"

    with pytest.raises(SimulationError, match="west_inn"):
        prepare_episode(changed(change), Population.load("tdbm_spectrum"), seed=0, episode=0, folder=tmp_path)


@pytest.mark.parametrize("name", [name for name in scenarios() if load_scenario(name).backend == "sumo"])
def test_lanes_inside_junctions_are_as_long_as_they_are_drawn(name: str) -> None:
    """SUMO gives all lanes of an edge one length; traffic seems to brake where one is drawn shorter."""
    network = read_network(compiled(load_scenario(name), 16.0))
    for lane in network.road.lanes:
        if lane.lane_id.startswith(":"):
            drawn = np.hypot(*np.diff(lane.centre_line_m.astype(np.float64), axis=0).T).sum()
            assert drawn == pytest.approx(network.length_m[lane.lane_id], abs=0.005), lane.lane_id
