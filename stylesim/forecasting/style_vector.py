"""`StyleVectorEmbedding`: the style as numbers, for a network; and how arms get equally many parameters for it."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from stylesim.errors import InputError
from stylesim.forecasting.config import ModelConfig
from stylesim.forecasting.style_embedding import StyleContextEmbedding
from stylesim.style import STYLE_CLASSES


class StyleVectorEmbedding(nn.Module):
    """A perceptron from a standardised style vector to one of the network's width; a row of NaN is the null token.

    So it is with probability `dropout` in training. Starts at length about 1, like `StyleContextEmbedding`.
    """

    def __init__(self, *, features: int, width: int, hidden: int, dropout: float = 0.125) -> None:
        super().__init__()
        if features < 1 or width < 1 or hidden < 1:
            raise InputError("features, width and hidden must be 1 or more")
        if not 0.0 <= dropout < 1.0:
            raise InputError(f"style dropout must lie in [0, 1), not {dropout}")
        self.features, self.dropout = features, dropout
        self.inner, self.outer = nn.Linear(features, hidden), nn.Linear(hidden, width)
        nn.init.normal_(self.outer.weight, std=(width * hidden) ** -0.5)
        self.null = nn.Parameter(torch.zeros(width))

    def forward(self, style: Float[Tensor, "batch feature"]) -> Float[Tensor, "batch width"]:
        """The embedding of each vector."""
        known = ~style.isnan().any(dim=1)
        if self.training and self.dropout > 0:
            known = known & (torch.rand(len(style), device=style.device) >= self.dropout)
        vector = self.outer(nn.functional.gelu(self.inner(style.nan_to_num())))
        return torch.where(known[:, None], vector, self.null)

    def unknown(self, batch: int, device: torch.device) -> Float[Tensor, "batch feature"]:
        """What asks for the null token."""
        return torch.full((batch, self.features), torch.nan, device=device)


StyleModule = StyleContextEmbedding | StyleVectorEmbedding


def style_parameters(config: ModelConfig, *, classes: int = 0) -> int:
    """Parameters of the largest style embedding among the conditions: cells of the six TDBM classes, or of more."""
    styles = max(classes, len(STYLE_CLASSES))
    width, k, c = config.width, config.clusters, config.contexts
    if config.reading == "R5":
        table = styles * k * c * width
    else:
        table = styles * (k + c) * width * (config.rank if config.reading == "R2" else 1)
    return table + width * (2 if config.reading == "R3" else 1)


def style_module(config: ModelConfig) -> StyleModule | None:
    """The embedding that the configuration asks for; None for a network without style.

    A perceptron is as wide as `style_parameters` allows, so that a control arm that is given numbers can do as much
    with them as a table can [ours].
    """
    if config.style_features:
        columns, width = config.style_features, config.width
        room = (config.style_parameters or style_parameters(config)) - 2 * width
        hidden = max(1, room // (columns + 1 + width))
        return StyleVectorEmbedding(features=columns, width=width, hidden=hidden, dropout=config.style_dropout)
    if not config.styles:
        return None
    return StyleContextEmbedding(
        styles=config.styles,
        width=config.width,
        clusters=config.clusters,
        contexts=config.contexts,
        reading=config.reading,
        rank=config.rank,
        dropout=config.style_dropout,
    )


def idle_parameters(config: ModelConfig, module: StyleModule | None) -> nn.Parameter | None:
    """Parameters that do nothing, so that every condition has `style_parameters` of them; None where none are missing.

    They are frozen: no optimizer moves them, and distributed training does not wait for their gradients.
    """
    used = 0 if module is None else sum(p.numel() for p in module.parameters())
    missing = config.style_parameters - used
    return nn.Parameter(torch.zeros(missing), requires_grad=False) if missing > 0 else None
