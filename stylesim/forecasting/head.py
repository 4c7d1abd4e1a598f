"""The head: from a query to a path, its spread and its log-odds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional

from stylesim.forecasting.config import ModelConfig
from stylesim.forecasting.layers import Perceptron

RESIDUAL_M = 10.0  # an output of 1 moves the end of the path by this much
SD_START_M, SD_GROWTH_MPS = 0.3, 0.5  # sd that an output of 0 stands for: at t = 0, and its growth
LOG_SD_RANGE = (-3.0, 5.0)  # 5 cm .. 148 m; MTR clips likewise to keep the likelihood finite [recalled]


@dataclass(frozen=True, eq=False)
class Modes:
    """A mixture over paths in the target's frame; in training only the paths that learn (one query each)."""

    mean_m: Float[Tensor, "batch path time 2"]
    log_sd: Float[Tensor, "batch path time 2"]
    logit: Float[Tensor, "batch query"]
    neighbour_m: Float[Tensor, "batch agent time 2"] | None = None  # with dense prediction, of the last layer

    def path_of(
        self, query: Int[Tensor, " batch"]
    ) -> tuple[Float[Tensor, "batch time 2"], Float[Tensor, "batch time 2"]]:
        """(mean, log sd) of one query per sample: the only one there is, or the one asked for."""
        if self.mean_m.shape[1] == 1:
            return self.mean_m[:, 0], self.log_sd[:, 0]
        row = torch.arange(len(query), device=query.device)
        return self.mean_m[row, query], self.log_sd[row, query]


class Head(nn.Module):
    """From a query to a path, its spread and its log-odds."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.steps = config.inputs.future_steps
        self.path = Perceptron(config.width, 4 * config.width, 4 * self.steps)
        self.odds = Perceptron(config.width, config.width, 1)
        time = torch.arange(1, self.steps + 1, dtype=torch.float32) * config.inputs.dt_s
        self.register_buffer("reach", (RESIDUAL_M * time / time[-1])[:, None], persistent=False)
        self.register_buffer("log_sd0", (SD_START_M + SD_GROWTH_MPS * time).log()[:, None], persistent=False)
        self.reach: Tensor
        self.log_sd0: Tensor

    def forward(
        self,
        query: Float[Tensor, "batch query width"],
        anchor: Float[Tensor, "batch query time 2"],
        learner: Int[Tensor, " batch"] | None = None,
    ) -> Modes:
        """The mixture; a path is its anchor plus what the network adds, which grows with time from 0.

        With `learner`, the path of that query alone.
        """
        logit = self.log_odds(query)
        if learner is not None:
            row = torch.arange(len(learner), device=learner.device)
            query, anchor = query[row, learner][:, None], anchor[row, learner][:, None]
        out = self.path(query).unflatten(-1, (self.steps, 4))  # [batch query time 4]
        mean = anchor + self.reach * out[..., :2]
        log_sd = (self.log_sd0 + out[..., 2:]).clamp(*LOG_SD_RANGE)
        return Modes(mean, log_sd, logit)

    def log_odds(self, query: Float[Tensor, "batch query width"]) -> Float[Tensor, "batch query"]:
        """How likely each query is, before the softmax over them."""
        odds: Tensor = self.odds(query)
        return odds.squeeze(-1)

    def hidden(self, query: Float[Tensor, "batch query width"]) -> Float[Tensor, "batch query hidden"]:
        """What the paths are read from (`mean`)."""
        found: Tensor = self.path[1](self.path[0](query))
        return found

    def mean(
        self, hidden: Float[Tensor, "batch query hidden"], anchor: Float[Tensor, "batch query time 2"]
    ) -> Float[Tensor, "batch query time 2"]:
        """The paths alone; with an anchor that has only the last step, the ends alone. For prediction."""
        start = self.steps - anchor.shape[2]
        last = cast(nn.Linear, self.path[2])
        weight = last.weight.view(self.steps, 4, -1)[start:, :2]  # [time 2 hidden]
        bias = last.bias.view(self.steps, 4)[start:, :2]  # [time 2]
        out = functional.linear(hidden, weight.flatten(0, 1), bias.flatten())
        return anchor + self.reach[start:] * out.view(*anchor.shape)
