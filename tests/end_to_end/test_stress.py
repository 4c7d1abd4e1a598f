"""`stress` from the command line as a user runs it: traffic is simulated, models examined, compared, examined again."""

from __future__ import annotations

import json
from pathlib import Path

import polars as pl
import pytest

from stylesim.corpus import Corpus
from tests.end_to_end.test_cli import stylesim

ADAPTER = '''
"""A forecaster at 2 Hz, in feet, with one mode and no map."""
import numpy as np
from stylesim.forecasting.arrays import FOOT_M, ArrayForecaster

def straight(arrays):
    return arrays["agent"][:, 0, -1, 2:4][:, None] * (0.5 * np.arange(1, 11))[:, None]

def factory():
    return ArrayForecaster("feet", straight, dt_s=0.5, history_s=2.0, future_s=5.0, unit_m=FOOT_M, road=False)
'''


@pytest.mark.slow
def test_the_whole_examination(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STYLESIM_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    Path("their_adapter.py").write_text(ADAPTER)
    names = ["kinematic_fan", "constant_velocity", "lane_following", "their_adapter:factory"]
    said = stylesim("stress", *names, "--quick", "--stride", 30, "--workers", 2, "--out", "stress")
    assert "kinematic_fan: minFDE" in said
    assert "judged up to 5 s, the horizon of feet; 6 s were asked for" in said
    traffic = {path.name for path in Path("stress.traffic").iterdir()}
    for scenario in ("yellow_light", "ramp_merge", "roundabout"):
        kinds = ("naturalistic", "rare_heavy", "twins", "twins_from_start", "fitting")
        assert {f"{kind}-{scenario}" for kind in kinds} <= traffic

    found = {name: json.loads(Path(f"stress/{name}.stress.json").read_text()) for name in ("kinematic_fan", "feet")}
    styles = {one["value"] for one in found["feet"]["accuracy"]["slices"] if one["by"] == "commanded"}
    assert {"aggressive", "reckless", "threatening", "careful", "cautious", "timid"} <= styles
    about = found["feet"]["accuracy"]["about"]
    assert (about["future_s"], about["asked_future_s"]) == (5.0, 6.0)  # cut to the shortest horizon of all
    assert found["feet"]["reliability"] == []  # one mode
    fan = found["kinematic_fan"]
    corpora = [Corpus(f"stress.traffic/rare_heavy-{name}") for name in ("yellow_light", "ramp_merge", "roundabout")]
    happened = {event["kind"] for corpus in corpora for scene in corpus for event in scene.metadata["events"]}
    assert happened == {"cut_in", "hard_brake", "jaywalker", "red_runner"}
    assert len({one["value"] for one in fan["events"]} - {"no event"}) >= 2  # that a window, one in 30 s, looks into
    assert fan["twins"]["identical"] == fan["twins"]["drivers"] > 0
    assert fan["twins_from_start"]["windows"]["twin"] > 0
    kinds = {(one["kind"], one["value"]) for one in fan["decisions"]["cells"] if one["by"] == "taken"}
    assert {("stop or go at the yellow", "stop"), ("stop or go at the yellow", "go")} <= kinds
    assert {("go first or yield", "first"), ("go first or yield", "yield")} <= kinds
    decided = {
        name: pl.read_parquet(f"stress/{name}.decisions.parquet") for name in ("kinematic_fan", "constant_velocity")
    }
    stopped = pl.col("taken") == "stop"
    held = {name: table.filter(stopped)["covered"].mean() for name, table in decided.items()}
    assert held["constant_velocity"] < 0.1  # it stops for nobody; at most a course beside the lane falls short
    assert held["kinematic_fan"] > 0.2  # one of six arcs brakes

    said = stylesim("compare", "stress/kinematic_fan.stress.json", "stress/feet.stress.json", "--report", "both.html")
    assert "kinematic_fan minus feet" in said
    assert "kinematic_fan against feet" in Path("both.html").read_text()

    again = stylesim("stress", *names, "--quick", "--stride", 30, "--traffic", "stress.traffic", "--out", "again")
    assert "kinematic_fan: minFDE" in again
    for name in ("kinematic_fan.stress.json", "feet.parquet", "lane_following.decisions.parquet"):
        assert Path("again", name).read_bytes() == Path("stress", name).read_bytes(), name
