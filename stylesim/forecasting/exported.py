"""Models in files: TorchScript, torch.export and ONNX, each with a small JSON beside it that says what it takes.

`model.pt`, `model.pt2` or `model.onnx` needs `model.json`:

    {"name": "mine", "inputs": ["agent", "piece"], "dt_s": 0.1, "history_s": 1.1, "future_s": 8.0,
     "unit_m": 1.0, "road": true, "agents": 16, "polylines": 64, "points": 10}

`inputs` are the arrays of `arrays.model_inputs` that the model takes, in its order; all batched by driver. It gives the
modes, or (modes, probability). TorchScript and exported programs are code of the model's author, like any model.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from stylesim.errors import InputError, MissingDependencyError, unknown
from stylesim.forecasting.arrays import INPUTS, ArrayForecaster
from stylesim.specs import Spec, parse

SUFFIXES = (".pt", ".pt2", ".onnx")
_Call = Callable[..., Any]


class ModelFile(Spec):
    """The JSON beside a model file."""

    name: str = ""
    inputs: tuple[str, ...] = Field(min_length=1)
    dt_s: float = Field(gt=0)
    history_s: float = Field(gt=0)
    future_s: float = Field(gt=0)
    unit_m: float = Field(default=1.0, gt=0)
    road: bool = True
    agents: int = Field(default=16, ge=1, le=1024)
    polylines: int = Field(default=64, ge=1, le=4096)
    points: int = Field(default=10, ge=2, le=1000)


def is_model_file(name: str) -> bool:
    """True for a file of one of the three kinds."""
    return Path(name).suffix in SUFFIXES and Path(name).is_file()


def model_file(path: Path) -> ArrayForecaster:
    """The model in that file as a forecaster. InputError for a missing or wrong JSON, or a file that does not load."""
    beside = path.with_suffix(".json")
    try:
        raw = json.loads(beside.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path} needs {beside.name} beside it, which says what the model takes") from None
    except ValueError as error:
        raise InputError(f"{beside} is no JSON: {error}") from None
    spec = parse(ModelFile, raw, str(beside))
    for name in spec.inputs:
        if name not in INPUTS:
            raise unknown("input", name, INPUTS, where=beside)
    call = _onnx(path) if path.suffix == ".onnx" else _torch(path)

    def model(arrays: Mapping[str, np.ndarray]) -> Any:
        return call(*(arrays[name] for name in spec.inputs))

    settings = spec.model_dump(exclude={"name", "inputs"})
    return ArrayForecaster(spec.name or path.stem, model, **settings)


def _torch(path: Path) -> _Call:
    import torch

    if not zipfile.is_zipfile(path):
        raise InputError(f"{path} is no model that torch can load: it is no zip archive")
    try:
        if path.suffix == ".pt2":
            module: Any = torch.export.load(str(path)).module()
        else:
            module = torch.jit.load(str(path), map_location="cpu")  # type: ignore[no-untyped-call]
            module.eval()
    except (RuntimeError, ValueError, OSError, KeyError) as error:
        words = str(error).splitlines()
        why = words[0] if words else type(error).__name__
        raise InputError(f"{path} is no model that torch {torch.__version__} can load: {why}") from error

    def call(*arrays: np.ndarray) -> Any:
        with torch.inference_mode():
            answer = module(*(torch.from_numpy(np.ascontiguousarray(array)) for array in arrays))
        several = answer if isinstance(answer, tuple | list) else (answer,)
        plain = tuple(item.numpy() for item in several)
        return plain if len(plain) > 1 else plain[0]

    return call


def _onnx(path: Path) -> _Call:
    try:
        import onnxruntime
    except ModuleNotFoundError:
        raise MissingDependencyError(
            f"{path} needs onnxruntime; install it with: pip install 'stylesim[onnx]'"
        ) from None
    try:
        session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    except Exception as error:
        raise InputError(f"{path} is no model that onnxruntime can load: {error}") from error
    names = [item.name for item in session.get_inputs()]

    def call(*arrays: np.ndarray) -> Any:
        if len(arrays) != len(names):
            raise InputError(f"{path}: the model takes {len(names)} inputs, {len(arrays)} are named in its JSON")
        answer = session.run(None, dict(zip(names, map(np.ascontiguousarray, arrays), strict=True)))
        return tuple(answer) if len(answer) > 1 else answer[0]

    return call
