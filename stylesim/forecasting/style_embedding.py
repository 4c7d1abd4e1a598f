"""`StyleContextEmbedding`: one vector per driving style, intra-style cluster and road context, for any network.

In an encoder-decoder of your own:

    self.style = StyleContextEmbedding(styles=6, width=256)
    ...
    token = token + self.style(style_cond)     # early: before self-attention; late: to each decoder query
    ...
    optimizer = AdamW(style_parameter_groups(model, lr=1e-4, weight_decay=0.01))
"""

from __future__ import annotations

from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from stylesim.errors import InputError, unknown
from stylesim.forecasting.config import READINGS

STYLE_LR_FACTOR = 5.0  # [ours] REFERENCE section 4: with small init and the common rate weak labels were ignored


class StyleContextEmbedding(nn.Module):
    """E[z, k, c] for style z, cluster k within it and context c (0 elsewhere, 1 highway).

    The paper: one library per style, E_z = e_k · e_c with e_k in R^{K×D} and e_c in R^{2×D} [paper]. As an inner
    product that would be a number; what is meant is open, so there are five readings [ours]:

    * R1 (default)  U[z,k] ⊙ W[z,c]
    * R2            Σ_r U_r[z,k] ⊙ W_r[z,c], rank r
    * R3 (literal)  ⟨U[z,k], W[z,c]⟩ v
    * R4            U[z,k] + W[z,c]
    * R5            a full table T[z,k,c]

    Start: U ~ N(0, 1/D), W = 1 (0 in R4, where W adds), the null token = 0. With z < 0 the null token is given; so
    it is with probability `dropout` in training, so that the model works unconditioned too.
    """

    def __init__(
        self,
        *,
        styles: int,
        width: int,
        clusters: int = 3,
        contexts: int = 2,
        reading: str = "R1",
        rank: int = 4,
        dropout: float = 0.125,
    ) -> None:
        super().__init__()
        if reading not in READINGS:
            raise unknown("reading", reading, READINGS)
        if styles < 1 or clusters < 1 or contexts < 1 or rank < 1:
            raise InputError("styles, clusters, contexts and rank must be 1 or more")
        if not 0.0 <= dropout < 1.0:
            raise InputError(f"style dropout must lie in [0, 1), not {dropout}")
        self.styles, self.clusters, self.contexts = styles, clusters, contexts
        self.reading, self.dropout = reading, dropout
        ranks = rank if reading == "R2" else 1
        of_cluster = (styles, clusters, contexts, width) if reading == "R5" else (styles, clusters, ranks, width)
        self.u = nn.Parameter(torch.randn(of_cluster) / (width * ranks) ** 0.5)
        if reading != "R5":
            start = torch.zeros if reading == "R4" else torch.ones
            self.w = nn.Parameter(start(styles, contexts, ranks, width))
        if reading == "R3":
            self.v = nn.Parameter(torch.randn(width) / width**0.5)
        self.null = nn.Parameter(torch.zeros(width))

    def forward(self, style: Int[Tensor, "batch 3"]) -> Float[Tensor, "batch width"]:
        """The embedding of each (z, k, c); the null token where z < 0."""
        known = style[:, 0] >= 0
        if self.training and self.dropout > 0:
            known = known & (torch.rand(len(style), device=style.device) >= self.dropout)
        z, k, c = style.clamp(min=0).unbind(dim=1)
        return torch.where(known[:, None], self._table(z, k, c), self.null)

    def unknown(self, batch: int, device: torch.device) -> Int[Tensor, "batch 3"]:
        """What asks for the null token."""
        return torch.full((batch, 3), -1, device=device)

    def _table(
        self, z: Int[Tensor, " batch"], k: Int[Tensor, " batch"], c: Int[Tensor, " batch"]
    ) -> Float[Tensor, "batch width"]:
        if self.reading == "R5":
            return self.u[z, k, c]
        u, w = self.u[z, k], self.w[z, c]  # [batch rank width]
        if self.reading == "R3":
            return (u * w).sum(dim=(1, 2))[:, None] * self.v
        if self.reading == "R4":
            return (u + w).sum(dim=1)
        return (u * w).sum(dim=1)


def style_parameter_groups(model: nn.Module, *, lr: float, weight_decay: float) -> list[dict[str, Any]]:
    """Groups for an optimizer: weight decay on matrices only, none on style embeddings, which learn faster."""
    style = {id(p) for m in model.modules() if isinstance(m, StyleContextEmbedding) for p in m.parameters()}
    learned = [p for p in model.parameters() if p.requires_grad]
    rest = [p for p in learned if id(p) not in style]
    groups: list[dict[str, Any]] = [
        {"params": [p for p in rest if p.ndim >= 2], "lr": lr, "weight_decay": weight_decay},
        {"params": [p for p in rest if p.ndim < 2], "lr": lr, "weight_decay": 0.0},
    ]
    if style:
        embedding = [p for p in learned if id(p) in style]
        groups.append({"params": embedding, "lr": lr * STYLE_LR_FACTOR, "weight_decay": 0.0})
    return groups
