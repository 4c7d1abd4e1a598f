"""Our metrics against the functions of the `av2` package on the same arrays."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from stylesim.evaluation.metrics import METRICS, forecast_errors

HERE = Path(__file__).parent
FROZEN = HERE / "fixtures" / "av2_metrics.json"
MAKER = HERE / "make_av2_numbers.py"


def check(records):
    case = runpy.run_path(str(MAKER))["case"]
    for record in records:
        forecast, chance, truth = case(record["case"], record["modes"], record["steps"])
        assert forecast.sum() + truth.sum() + chance @ np.arange(record["modes"]) == pytest.approx(record["checksum"])
        ours = forecast_errors(forecast[None], chance[None], truth[None])
        for name in METRICS:
            assert getattr(ours, name)[0] == pytest.approx(record[name], abs=1e-9), (record["case"], name)
        assert ours.best_mode[0] == record["best_mode"]


def test_equal_to_frozen_numbers_of_av2():
    frozen = json.loads(FROZEN.read_text())
    assert len(frozen["records"]) == 6
    assert {record["miss_rate"] for record in frozen["records"]} == {0.0, 1.0}
    check(frozen["records"])


@pytest.mark.slow
def test_equal_to_av2_itself(tmp_path):
    """Makes an environment for av2 (its pyarrow and OpenCV have no place in ours) and compares live."""
    python = tmp_path / "env" / "bin" / "python"
    pip = [str(python), "-m", "pip", "-q", "--disable-pip-version-check", "install"]
    try:
        subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "env")], check=True, capture_output=True)
        subprocess.run([*pip, "numpy", "universal-pathlib"], check=True, capture_output=True, timeout=300)
        subprocess.run([*pip, "--no-deps", "av2==0.3.6"], check=True, capture_output=True, timeout=300)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        pytest.skip(f"no environment for av2 could be made (no network?): {error}")
    subprocess.run([str(python), str(MAKER), str(tmp_path / "live.json")], check=True, capture_output=True)
    check(json.loads((tmp_path / "live.json").read_text())["records"])
