"""Cells of estimates."""

from __future__ import annotations

from stylesim.evaluation.intervals import Estimate
from stylesim.report.tables import estimate_cell


def difference(value: float, low: float, high: float) -> Estimate:
    return Estimate(value, low, high, n_drivers=100, n_units=10, status="general")


def test_differences_from_zero_are_marked():
    assert estimate_cell(difference(-0.5, -0.9, -0.1), judge=True).look == "better"
    assert estimate_cell(difference(0.5, 0.1, 0.9), judge=True).look == "worse"
    assert estimate_cell(difference(0.5, -0.1, 0.9), judge=True).look == "number"


def test_rounding_errors_are_not_marked():
    assert estimate_cell(difference(-1e-7, -2e-7, -1e-8), judge=True).look == "number"
