"""What is measured on the validation split after every epoch."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from stylesim.forecasting.data import Example
from stylesim.forecasting.mixing import TrainingSet
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.objective import mixture_loss
from stylesim.forecasting.selection import selected_modes
from stylesim.randomness import stream

MOST_SAMPLES = 2048  # chosen: a few seconds on two cores; which ones depends on the seed only
BATCH = 256


def validated(network: ForecastNetwork, data: TrainingSet, *, seed: int, device: torch.device) -> dict[str, float]:
    """Means over (at most MOST_SAMPLES) validation samples: val_loss (nats), min_ade_m, min_fde_m, brier_fde_m.

    With a style embedding also style_effect_m: how far the best mode's end moves when the style is taken away; a
    model that ignores the style has 0 there.
    """
    index = data.split(1)
    if len(index) > MOST_SAMPLES:
        index = np.sort(stream(seed, 0, "", "validation").choice(index, MOST_SAMPLES, replace=False))
    network.eval()
    rows = []
    with torch.no_grad():
        for part in np.split(index, range(BATCH, len(index), BATCH)):
            rows.append(_measured(network, data.example(part, device)).cpu().numpy())
    mean = np.concatenate(rows).mean(axis=0, dtype=np.float64)
    names = ("val_loss", "min_ade_m", "min_fde_m", "brier_fde_m", "style_effect_m")
    used = names if network.style is not None else names[:-1]
    return {name: float(value) for name, value in zip(used, mean, strict=False)}


def min_fde_m(network: ForecastNetwork, example: Example) -> Float[Tensor, " batch"]:
    """Of each sample: how far the nearest of the modes ends from where the agent went."""
    last, config = network(example.inputs, example.style)[-1], network.config
    path, _ = selected_modes(last.mean_m, last.logit, count=config.modes, apart_m=config.nms_m)
    return (path[:, :, -1] - example.future_m[:, None, -1]).norm(dim=-1).min(dim=1).values


def _measured(network: ForecastNetwork, example: Example) -> Float[Tensor, "batch 5"]:
    layers = network(example.inputs, example.style)
    loss = mixture_loss(layers, network.anchors(example.inputs), example.future_m)
    config, last = network.config, layers[-1]
    path, chance = selected_modes(last.mean_m, last.logit, count=config.modes, apart_m=config.nms_m)
    error = (path - example.future_m[:, None]).norm(dim=-1)  # [batch mode time]
    fde, best = error[:, :, -1].min(dim=1)
    brier = fde + (1 - chance.gather(1, best[:, None])[:, 0]).square()
    effect = torch.zeros_like(fde)
    if network.style is not None:
        without = network(example.inputs, None)[-1]
        query = last.logit.argmax(dim=1)
        row = torch.arange(len(query), device=query.device)
        effect = (last.mean_m[row, query, -1] - without.mean_m[row, query, -1]).norm(dim=-1)
    return torch.stack([loss, error.mean(dim=2).min(dim=1).values, fde, brier, effect], dim=1)
