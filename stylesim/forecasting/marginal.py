"""Forecasts for every style made into one: sum_z pi(z | x) p(y | x, z), as few modes again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Float

from stylesim.forecast import Forecast, ForecastTask
from stylesim.forecasting.conditions import SEES_FUTURE
from stylesim.forecasting.selection import selected_modes

if TYPE_CHECKING:
    from stylesim.forecasting.forecaster import TrainedForecaster

NO_STYLE = "none"  # as `style` of predict: the null token for everyone
MARGINAL = "marginal"  # as `style` of predict: the average over the posterior of styles


def averaged(
    by_style: Sequence[Forecast], weight: Float[np.ndarray, "driver style"], *, count: int, apart_m: float
) -> Forecast:
    """The `count` modes that are left of the forecasts for all styles, which have these probabilities.

    Every mode keeps its path and gets the probability of its style times its own; then they are selected as the modes
    of one style are (`selected_queries`): what is not kept gives its probability to the nearest that is.
    """
    path = torch.from_numpy(np.concatenate([one.mode_m for one in by_style], axis=1))
    joint = [weight[:, [z]] * one.probability for z, one in enumerate(by_style)]
    chance = torch.from_numpy(np.concatenate(joint, axis=1).astype(np.float32))
    kept, probability = selected_modes(path, chance.log(), count=count, apart_m=apart_m)
    return Forecast(kept.numpy(), probability.numpy())


class AsStyle:
    """A trained forecaster that is always asked with the same `style`: a class, "none" or "marginal".

    An oracle that is given a style, or averages over them, is told no truth; so it loses its mark here.
    """

    def __init__(self, forecaster: TrainedForecaster, style: str) -> None:
        self.forecaster, self.style = forecaster, forecaster.known_style(style)
        self.name = f"{forecaster.name.removesuffix(f' ({SEES_FUTURE})')}@{style}"
        if style == NO_STYLE:
            self.styles: tuple[str, ...] = ()  # told nothing: see `forecast.is_untold`

    @property
    def horizon_s(self) -> float:
        """How far it can look, in seconds."""
        return self.forecaster.horizon_s

    @property
    def earlier_s(self) -> float:
        """How many seconds before the history it would like to see."""
        return self.forecaster.earlier_s

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """Modes for every task."""
        return self.forecaster.predict(tasks, self.style)
