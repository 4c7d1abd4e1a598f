"""Our metrics against UniTraj's definitions, computed by an independent script in plain Python."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

from stylesim.evaluation.metrics import forecast_errors

HERE = Path(__file__).parent
FROZEN = HERE / "fixtures" / "unitraj_metrics.json"
NAMES = ("min_ade_m", "min_fde_m", "miss_rate", "brier_fde_m")
BY_HAND = [(2 / 3, 2.0, 0.0, 2.5625), (5.0, 5.0, 1.0, 5.0), (1.0, 2.0, 0.0, 2.25), (1.0, 1.0, 0.0, 1.5625)]


def records():
    return json.loads(FROZEN.read_text())["records"]


def test_equal_to_the_frozen_numbers():
    for number, record in enumerate(records()):
        modes, truth = np.array(record["modes"]), np.array(record["truth"])
        ours = forecast_errors(modes[None], np.array([record["chance"]]), truth[None], np.array([record["valid"]]))
        for name in NAMES:
            assert getattr(ours, name)[0] == pytest.approx(record[name], abs=1e-9), (number, name)


def test_the_frozen_numbers_are_those_of_a_calculation_by_hand():
    for record, expected in zip(records(), BY_HAND, strict=False):
        assert [record[name] for name in NAMES] == pytest.approx(expected)


def test_the_fixture_is_what_its_script_writes_and_holds_the_hard_cases(tmp_path):
    runpy.run_path(str(HERE / "make_unitraj_numbers.py"))["main"](tmp_path / "again.json")
    again = json.loads((tmp_path / "again.json").read_text())["records"]
    frozen = records()
    assert [r["valid"] for r in again] == [r["valid"] for r in frozen]
    for one, other in zip(again, frozen, strict=True):
        assert [one[name] for name in NAMES] == pytest.approx([other[name] for name in NAMES])
    drawn = frozen[len(BY_HAND) :]
    assert any(not record["valid"][-1] for record in drawn)
    assert {record["miss_rate"] for record in drawn} == {0.0, 1.0}
