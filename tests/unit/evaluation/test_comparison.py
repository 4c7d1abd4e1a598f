"""Two examinations side by side: decisions are paired, the rest stands beside each other."""

from __future__ import annotations

import json

import polars as pl
import pytest

from stylesim.errors import InputError
from stylesim.evaluation.comparison import compare, decision_differences
from stylesim.evaluation.decisions import STOP_OR_GO
from stylesim.evaluation.stress import stress
from stylesim.evaluation.stress_corpora import own_traffic
from stylesim.evaluation.stress_decisions import SCHEMA


def decided(mass, n=60):
    """Drivers who went and stopped in turn; `mass(i)` is what the forecast gave to what driver i did."""
    rows = [
        {
            "unit_id": f"u{i // 4}", "agent_id": f"a{i}", "scene_id": f"s{i // 4}", "t0_frame": 40, "scenario": "light",
            "commanded": "timid", "kind": STOP_OR_GO, "taken": ("go", "stop")[i % 2], "with an event": "in none",
            "covered": float(mass(i) > 0), "mass": mass(i), "top_right": float(mass(i) > 0.5),
            "brier": (1 - mass(i)) ** 2,
        }
        for i in range(n)
    ]  # fmt: skip
    return pl.DataFrame(rows, schema=SCHEMA)


def test_decisions_are_paired_by_driver():
    sure, blind = decided(lambda i: 0.9 if i % 2 else 0.7), decided(lambda i: 0.0 if i % 2 else 0.7)
    found = decision_differences(sure, blind.sample(fraction=1.0, shuffle=True, seed=3), seed=0)
    stop = found[STOP_OR_GO, "taken"]["stop"]
    assert (stop["covered"].value, stop["mass"].value) == pytest.approx((1.0, 0.9))
    assert stop["brier"].value == pytest.approx(0.01 - 1.0)
    assert found[STOP_OR_GO, "taken"]["go"]["mass"].value == 0.0
    assert found[STOP_OR_GO, "all"]["all"]["covered"].excludes_zero


def test_other_decisions_are_refused():
    with pytest.raises(InputError, match="different decisions"):
        decision_differences(decided(lambda i: 1.0), decided(lambda i: 1.0, n=56), seed=0)


def test_two_stress_tests_beside_each_other(world, small_corpus, tmp_path):
    for name, factors in (("fan", (1.0, 0.9, 1.1)), ("one", (1.0,))):
        stress(world.ConstantVelocity(factors, name=name), own_traffic(small_corpus)).save(tmp_path / name)
    found = compare(tmp_path / "fan.stress.json", tmp_path / "one.stress.json")
    assert found.cells["all"]["all"]["min_fde_m"].value < 0  # more modes
    calibration = [one for one in found.figures if one.group == "calibration"]
    assert calibration[0].ours.value >= 0
    assert calibration[0].theirs is None  # one mode has nothing to calibrate
    assert json.loads(json.dumps(found.to_dict()))["theirs"] == "one"
    same = compare(tmp_path / "one.stress.json", tmp_path / "one.stress.json", by="scenario")
    assert list(same.cells) == ["all", "scenario"]
    assert all(
        one.value == 0 for cells in same.cells.values() for metrics in cells.values() for one in metrics.values()
    )
