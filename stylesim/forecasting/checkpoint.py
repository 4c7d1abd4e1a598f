"""The file form of a trained forecaster: plain tensors and JSON, read with nothing that could run code."""

from __future__ import annotations

import io
import json
import pickle
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.forecasting.conditioner import FORMS, StyleConditioner
from stylesim.forecasting.conditions import condition_of
from stylesim.forecasting.config import ModelConfig
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.posterior import StylePosterior

RECORD_FILE = "training.json"  # settings, corpus and loss curve, for the report
MODEL_FILE = "model.pt"
FORMAT, VERSION = "stylesim-forecaster", 2  # raise it when the network's weights change meaning


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]


def write_tensors(path: Path, content: Mapping[str, Any]) -> None:
    """A file of tensors, numbers and strings, whole or not at all; CorpusError for a full disk."""
    buffer = io.BytesIO()
    torch.save(dict(content), buffer)
    write_whole(path, buffer.getvalue())


def read_tensors(path: Path, *, format_name: str, version: int) -> dict[str, Any]:
    """The content of such a file; InputError if it is missing, damaged, not ours, or of another version."""
    refused = f"{path} is not a checkpoint of stylesim"
    try:
        with warnings.catch_warnings(action="ignore", category=UserWarning):  # of foreign pickles: refused below
            content = torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError:
        raise InputError(f"no such file: {path}; train a model with `stylesim train`") from None
    except pickle.UnpicklingError:  # torch's text proposes to run what is in the file
        raise InputError(f"{refused}: it holds something other than tensors; it was not loaded") from None
    except (OSError, RuntimeError, EOFError, zipfile.BadZipFile, ValueError, KeyError, AttributeError) as error:
        raise InputError(f"{refused}, or it is damaged: {_first_line(error)}") from None
    if not isinstance(content, dict) or content.get("format") != format_name:
        raise InputError(f"{refused}: it has no {format_name!r} mark")
    found = content.get("version")
    if not isinstance(found, int) or found > version:
        raise InputError(f"{path} has version {found}; this stylesim reads version {version}: install a newer one")
    if found < version:
        raise InputError(f"{path} has version {found}, of an older network than this one ({version}): train anew")
    return content


def save(forecaster: TrainedForecaster, path: Path) -> None:
    """Write a forecaster to a file."""
    state: dict[str, Tensor] = {key: value.cpu() for key, value in forecaster.network.state_dict().items()}
    conditioner = None if forecaster.conditioner is None else forecaster.conditioner.to_dict()
    content = {
        "format": FORMAT,
        "version": VERSION,
        "name": forecaster.name,
        "config": json.dumps(forecaster.config.to_dict()),
        "conditioner": json.dumps(conditioner),
        "state": state,
    }
    write_tensors(path, content)


def load(path: str | Path) -> TrainedForecaster:
    """The forecaster in a folder that `train` made, or in its model.pt; InputError if it is none of ours."""
    file = Path(path)
    file = file / MODEL_FILE if file.is_dir() else file
    content = read_tensors(file, format_name=FORMAT, version=VERSION)
    try:
        config = ModelConfig.from_dict(json.loads(content["config"]))
        conditioner = conditioner_from_dict(json.loads(content["conditioner"]))
        with torch.random.fork_rng():  # its start weights are drawn, then overwritten
            network = ForecastNetwork(config)
        network.load_state_dict(content["state"])
        forecaster = TrainedForecaster(str(content["name"]), network, conditioner)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise InputError(f"{file} is a damaged checkpoint: {_first_line(error)}") from error
    forecaster.training_curve = _curve(file.with_name(RECORD_FILE))
    return forecaster


def _curve(record: Path) -> tuple[Mapping[str, float], ...]:
    """The loss curve in the record beside a checkpoint; () where there is no record."""
    if not record.is_file():
        return ()
    try:
        curve = json.loads(record.read_bytes())["curve"]
        return tuple({key: float(value) for key, value in epoch.items()} for epoch in curve)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{record} is no record of a training: {error!r}") from error


def conditioner_from_dict(raw: Mapping[str, Any] | None) -> StyleConditioner | None:
    """The inverse of `StyleConditioner.to_dict`; None for None."""
    if raw is None:
        return None
    from stylesim.forecasting.judging import LabelerJudges

    judges = LabelerJudges.from_dict(raw["judges"])
    form = FORMS[condition_of(raw["condition"]).form]
    learned = raw.get("posterior")  # absent from models of the first format
    posterior = None if learned is None else StylePosterior.from_dict(learned)
    return StyleConditioner(raw["condition"], judges, form.from_dict(raw["cells"]), posterior)
