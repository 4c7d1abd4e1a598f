"""A world in which nothing but the style decides the future: who has it must win, who has not must not."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from stylesim.forecasting.batching import Batch
from stylesim.forecasting.config import FUSIONS, InputConfig, ModelConfig
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.objective import mixture_loss
from stylesim.forecasting.style_embedding import style_parameter_groups
from stylesim.forecasting.tensors import TensorBatch

CONFIG = InputConfig(dt_s=0.2, history_steps=5, future_steps=10, agents=1, polylines=1, points=2)
SAMPLES = 32


def world() -> tuple[TensorBatch, torch.Tensor, torch.Tensor]:
    """Everybody drives 10 m/s; style 0 then brakes and style 1 accelerates with 5 m/s2."""
    agent = np.zeros((SAMPLES, 1, 5, 7), np.float32)
    agent[..., 0] = -2.0 * np.arange(4, -1, -1)
    agent[..., 2], agent[..., 4], agent[..., 6] = 10.0, 1.0, 1.0
    batch = Batch(
        agent=agent,
        agent_attribute=np.zeros((SAMPLES, 1, 11), np.float32),
        agent_valid=np.ones((SAMPLES, 1), bool),
        piece=np.zeros((SAMPLES, 1, 2, 2), np.float32),
        piece_attribute=np.zeros((SAMPLES, 1, 14), np.float32),
        piece_valid=np.zeros((SAMPLES, 1), bool),
        pose=np.zeros((SAMPLES, 3), np.float32),
        agent_row=np.zeros((SAMPLES, 1), np.int64),
    )
    style = torch.zeros(SAMPLES, 3, dtype=torch.int64)
    style[SAMPLES // 2 :, 0] = 1
    time = torch.arange(1, 11) * 0.2
    acceleration = torch.where(style[:, 0] == 0, -5.0, 5.0)
    along = 10.0 * time + 0.5 * acceleration[:, None] * time**2
    return TensorBatch.of(batch), style, torch.stack([along, torch.zeros_like(along)], dim=-1)


def on_the_right_side(logit: torch.Tensor, style: torch.Tensor) -> torch.Tensor:
    """Probability of the two intentions to brake most for style 0, of those to accelerate most for style 1."""
    chance = logit.softmax(dim=1)
    return torch.where(style[:, 0] == 0, chance[:, :2].sum(dim=1), chance[:, -2:].sum(dim=1))


@pytest.mark.parametrize("fusion", FUSIONS)
def test_a_style_that_decides_the_future_is_used(fusion: str) -> None:
    torch.manual_seed(0)
    config = ModelConfig(
        CONFIG, width=16, queries=6, encoder_layers=1, decoder_layers=1, dropout=0.0, fusion=fusion, styles=2
    )
    model = ForecastNetwork(config)
    model.intention_mps2[:, :, 0] = torch.linspace(-5.0, 5.0, 6)  # ends 4 m apart
    inputs, style, future = world()
    optimizer = torch.optim.Adam(style_parameter_groups(model, lr=3e-3, weight_decay=0.0))
    before = model.style.u.detach().clone() if model.style is not None else torch.zeros(0)
    model.train()
    for _ in range(300):
        loss = mixture_loss(model(inputs, style), model.anchors(inputs), future).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    model.eval()
    with torch.no_grad():
        knowing, ignorant = (model(inputs, s)[-1] for s in (style, None))
    right = torch.where(style[:, 0] == 0, 0, 5)
    row = torch.arange(SAMPLES)
    assert on_the_right_side(knowing.logit, style).min() > 0.9
    assert (knowing.mean_m[row, right, -1] - future[:, -1]).norm(dim=1).max() < 0.5
    assert on_the_right_side(ignorant.logit, style).mean() < 0.51  # nothing tells it which
    assert model.style is not None
    assert (model.style.u - before).abs().max() > 0.05
