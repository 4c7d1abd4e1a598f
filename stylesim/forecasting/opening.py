"""A forecaster by name: a trained model's folder, or a baseline."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from stylesim.errors import unknown
from stylesim.forecast import Forecaster
from stylesim.forecasting.baselines import ConstantTurnRate, ConstantVelocity

BASELINES: dict[str, Callable[[], Forecaster]] = {
    ConstantVelocity.name: ConstantVelocity,
    ConstantTurnRate.name: ConstantTurnRate,
}


def open_forecaster(name: str) -> Forecaster:
    """The baseline of that name, or the model in that folder. InputError if it is neither."""
    if name in BASELINES:
        return BASELINES[name]()
    if not Path(name).exists():
        raise unknown("forecaster", name, BASELINES, where="baselines and folders")
    from stylesim.forecasting.checkpoint import load

    return load(name)
