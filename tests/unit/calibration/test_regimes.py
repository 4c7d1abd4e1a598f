from __future__ import annotations

from pathlib import Path

import pytest

from stylesim.calibration import calibrate
from stylesim.calibration.regimes import DENSER, chosen_regimes
from stylesim.errors import InputError
from stylesim.scenario import load_scenario


def test_the_held_out_density_begins_where_the_calibrated_one_ends():
    regimes = chosen_regimes("sumo", ["motorway"], "lane_drop")
    try:
        dense = load_scenario(regimes.dense_folders[0]).parameters["demand_vph"]
        high = load_scenario("motorway").parameters["demand_vph"].high
        assert high is not None
        assert (dense.low, dense.high) == (high, pytest.approx(DENSER * high))
        assert regimes.roads == ("motorway",)
        assert regimes.held_out_name == "lane_drop"
    finally:
        regimes.close()


def test_by_default_the_held_out_scenario_is_left_out():
    regimes = chosen_regimes("sumo", [], "")
    try:
        assert regimes.held_out_name not in regimes.names
        assert {"motorway", "corridor"} <= set(regimes.names)
        assert regimes.roads == ("motorway", "other")
    finally:
        regimes.close()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"backend": "sumoo"}, "Did you mean 'sumo'"),
        ({"backend": "sumo", "scenarios": ["highway"]}, "runs in 'highway'"),
        ({"backend": "sumo", "scenarios": ["motorway"], "held_out": "motorway"}, "name it once"),
        ({"backend": "sumo", "rounds": 0}, "rounds must be at least 1"),
        ({"backend": "sumo", "scaler": "sim-referense"}, "Did you mean 'sim-reference'"),
    ],
)
def test_what_cannot_be_calibrated_is_refused_before_any_work(tmp_path, arguments, says):
    with pytest.raises(InputError, match=says):
        calibrate(**arguments, out=tmp_path / "x.yaml")
    assert not list(tmp_path.iterdir())


def test_an_existing_file_is_not_overwritten(tmp_path: Path):
    target = tmp_path / "x.yaml"
    target.write_text("mine")
    with pytest.raises(InputError, match="there already"):
        calibrate("sumo", out=target)
    assert target.read_text() == "mine"
