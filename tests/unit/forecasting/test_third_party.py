"""The forecaster of the tutorial, from a package that nobody here wrote, keeps the contract of any forecaster."""

from __future__ import annotations

import ast
import json
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from stylesim.evaluation.evaluate import common_spec
from stylesim.forecasting.baselines import ConstantVelocity
from stylesim.forecasting.opening import open_forecaster
from stylesim.windows import WindowSpec
from tests.conftest import ROOT, make_scene
from tests.contract.test_forecaster import ForecasterContract, asked

pytest.importorskip("bayesian_filters", reason="pip install 'stylesim[tutorial]'")
pytestmark = pytest.mark.filterwarnings("ignore:.*scipy.ndimage.*:DeprecationWarning")  # the package's own


def adapter() -> str:
    """The cell of the notebook that writes the adapter's file: what the reader sees is what is tested."""
    book = json.loads((ROOT / "notebooks" / "02_examine_your_model.ipynb").read_text(encoding="utf-8"))
    (cell,) = [c for c in book["cells"] if "".join(c["source"]).startswith("%%writefile kalman_adapter.py")]
    return "".join(cell["source"][1:])


@pytest.fixture
def kalman(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "kalman_adapter.py").write_text(adapter())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield open_forecaster("kalman_adapter:factory")
    sys.modules.pop("kalman_adapter", None)


def test_the_adapter_is_twenty_lines() -> None:
    """Its imports, `predict` and `factory`; the filter that it holds is the model."""
    body = ast.parse(adapter()).body
    lines = Counter(type(node).__name__ for node in body if isinstance(node, ast.Import | ast.ImportFrom))
    length = sum(
        node.end_lineno - node.lineno + 1
        for node in body
        if isinstance(node, ast.FunctionDef) and node.name in ("predict", "factory")
    )
    assert length + lines.total() <= 20


class TestKalman(ForecasterContract):
    @pytest.fixture
    def forecaster(self, kalman):
        return kalman


def test_three_modes_at_five_hertz_without_a_map(kalman) -> None:
    task = asked(make_scene(n_agents=6), future_steps=60)
    forecast = kalman.predict([task])[0]
    assert forecast.probability.shape == (len(task.agent_index), 3)
    assert np.ptp(forecast.probability, axis=1).max() > 0.05  # they are not all alike
    straight = ConstantVelocity().predict([task])[0].mode_m
    assert np.linalg.norm(forecast.mode_m[:, 0, 9] - straight[:, 0, 9], axis=-1).max() < 1.5  # after a second
    assert common_spec([kalman, ConstantVelocity()], WindowSpec(5.0, 8.0)).future_s == 6.0
