from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from stylesim.errors import InputError
from stylesim.forecasting.baselines import ConstantVelocity
from stylesim.forecasting.opening import open_forecaster
from tests.conftest import make_scene
from tests.contract.test_forecaster import asked

SPEC: dict[str, Any] = {"inputs": ["agent"], "dt_s": 0.1, "history_s": 2.0, "future_s": 3.0}


class Straight(torch.nn.Module):
    """Constant velocity, and a second mode that stands."""

    def forward(self, agent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        steps = torch.arange(1, 31, dtype=torch.float32) * 0.1
        path = agent[:, 0, -1, None, 2:4] * steps[None, :, None]
        modes = torch.stack([path, torch.zeros_like(path)], dim=1)
        return modes, torch.tensor([0.75, 0.25]).expand(agent.shape[0], 2)


def torchscript(path: Path) -> None:
    with pytest.warns(DeprecationWarning, match="torch.jit"):
        torch.jit.script(Straight()).save(str(path))


def exported(path: Path) -> None:
    batch = torch.export.Dim("drivers")
    torch.export.save(
        torch.export.export(Straight(), (torch.zeros(2, 16, 20, 7),), dynamic_shapes=({0: batch},)), str(path)
    )


def onnx_file(path: Path) -> None:
    """The same as a graph of ONNX operators."""
    onnx = pytest.importorskip("onnx")
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    constant = {
        "first": np.array([0]), "last": np.array([-1]), "two": np.array([2]), "four": np.array([4]),
        "agents": np.array([1]), "times": np.array([2]), "channel": np.array([3]),
    }  # fmt: skip
    made = [onnx.numpy_helper.from_array(value.astype(np.int64), name) for name, value in constant.items()]
    made.append(onnx.numpy_helper.from_array((0.1 * np.arange(1, 31, dtype=np.float32)).reshape(1, 1, 30, 1), "t"))
    made.append(onnx.numpy_helper.from_array(np.array([1]), "one"))
    made.append(onnx.numpy_helper.from_array(np.array([2**31]), "end"))
    nodes = [
        helper.make_node("Slice", ["agent", "first", "one", "agents"], ["driver"]),
        helper.make_node("Slice", ["driver", "last", "end", "times"], ["now"]),
        helper.make_node("Slice", ["now", "two", "four", "channel"], ["velocity"]),  # (N, 1, 1, 2)
        helper.make_node("Mul", ["velocity", "t"], ["modes"]),
    ]
    graph = helper.make_graph(
        nodes,
        "straight",
        [helper.make_tensor_value_info("agent", kind, ["n", 16, 20, 7])],
        [helper.make_tensor_value_info("modes", kind, ["n", 1, 30, 2])],
        made,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.save(model, str(path))


@pytest.mark.parametrize(
    ("name", "write"), [("m.pt", torchscript), ("m.pt2", exported), ("m.onnx", onnx_file)], ids=["pt", "pt2", "onnx"]
)
@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_a_model_file_forecasts_as_the_model_did(tmp_path: Path, name: str, write: Any) -> None:
    if name.endswith("onnx"):
        pytest.importorskip("onnxruntime")
    write(tmp_path / name)
    (tmp_path / "m.json").write_text(json.dumps(SPEC))
    forecaster = open_forecaster(str(tmp_path / name))
    assert forecaster.name == "m"
    task = asked(make_scene(n_agents=6))
    forecast, ours = forecaster.predict([task])[0], ConstantVelocity().predict([task])[0]
    np.testing.assert_allclose(forecast.mode_m[:, 0], ours.mode_m[:, 0], atol=1e-2)
    if forecast.probability.shape[1] == 2:
        np.testing.assert_allclose(forecast.probability, [[0.75, 0.25]] * len(task.agent_index))


def test_what_is_wrong_with_a_model_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "m.pt2"
    path.write_bytes(b"not a model")
    with pytest.raises(InputError, match=r"needs m\.json beside"):
        open_forecaster(str(path))
    (tmp_path / "m.json").write_text("{")
    with pytest.raises(InputError, match="no JSON"):
        open_forecaster(str(path))
    (tmp_path / "m.json").write_text(json.dumps({**SPEC, "inputs": ["agnt"]}))
    with pytest.raises(InputError, match="Did you mean 'agent'"):
        open_forecaster(str(path))
    (tmp_path / "m.json").write_text(json.dumps({**SPEC, "histry_s": 1.0}))
    with pytest.raises(InputError, match="histry_s"):
        open_forecaster(str(path))
    (tmp_path / "m.json").write_text(json.dumps(SPEC))
    for kind in ("m.pt2", "m.pt"):
        (tmp_path / kind).write_bytes(b"not a model")
        with pytest.raises(InputError, match="no model that torch"):
            open_forecaster(str(tmp_path / kind))
    with pytest.raises(InputError, match="no forecaster is read from"):
        open_forecaster(str(tmp_path / "m.json"))
