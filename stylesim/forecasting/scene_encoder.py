"""The encoder: agents and lane pieces of a scene become what the decoder's queries look at."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from stylesim.forecasting.batching import AGENT_ATTRIBUTES, AGENT_FEATURES, PIECE_ATTRIBUTES
from stylesim.forecasting.config import ModelConfig
from stylesim.forecasting.layers import EncoderLayer, PatchEncoder, Perceptron, scale
from stylesim.forecasting.tensors import TensorBatch

METRE, MPS, SECOND = 0.05, 0.1, 0.2  # features of 20 m, 10 m/s, 5 s become 1


class SceneEncoder(nn.Module):
    """Agents as tokens that know of each other and of the lanes, the target first; lane pieces as keys and values.

    All attention to the lanes, here and in the decoder, shares one set of keys and values: no layer changes a piece,
    and to project 64 of them anew in each of four layers took a seventh of the time.
    """

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        width, inputs = config.width, config.inputs
        self.history = PatchEncoder(
            steps=inputs.history_steps, features=AGENT_FEATURES, patch=config.patch_steps, width=width
        )
        self.agent = nn.Linear(AGENT_ATTRIBUTES, width)
        self.piece = Perceptron(2 * inputs.points + PIECE_ATTRIBUTES, 2 * width, width)
        self.layers = nn.ModuleList(
            EncoderLayer(width, config.heads, config.dropout) for _ in range(config.encoder_layers)
        )
        self.norm = nn.LayerNorm(width)
        self.piece_key_value = nn.Sequential(nn.LayerNorm(width), nn.Linear(width, 2 * width))
        agent_scale = scale([METRE, METRE, MPS, MPS, 1.0, 1.0, 1.0])
        # width, limit, known, junction, inferred, stop known, stop x y, one-hot signal, its age
        piece_scale = scale([0.2, METRE, 1.0, 1.0, 1.0, 1.0, METRE, METRE, 1.0, 1.0, 1.0, 1.0, 1.0, SECOND])
        self.register_buffer("agent_scale", agent_scale, persistent=False)
        self.register_buffer("piece_scale", piece_scale, persistent=False)
        self.agent_scale: Tensor
        self.piece_scale: Tensor

    def tokens(
        self, batch: TensorBatch
    ) -> tuple[Float[Tensor, "batch agent width"], Float[Tensor, "batch piece 2*width"]]:
        """One token per agent; key and value of each lane piece."""
        agent = self.history(batch.agent * self.agent_scale) + self.agent(batch.agent_attribute)  # [batch agent width]
        points = METRE * batch.piece.flatten(2)  # [batch piece 2*point]
        piece = self.piece(torch.cat([points, batch.piece_attribute * self.piece_scale], dim=-1))
        return agent, self.piece_key_value(piece)

    def forward(
        self,
        batch: TensorBatch,
        bias: Float[Tensor, "batch 1 1 token"],
        early: Float[Tensor, "batch width"] | None,
    ) -> tuple[Float[Tensor, "batch agent width"], Float[Tensor, "batch piece 2*width"]]:
        """Agents and lane pieces; `early` is added to the target's token before any attention."""
        agent, piece = self.tokens(batch)
        if early is not None:
            agent = added_to_target(agent, early)
        for layer in self.layers:
            agent = layer(agent, piece, bias)
        return self.norm(agent), piece


def added_to_target(
    token: Float[Tensor, "batch token width"], style: Float[Tensor, "batch width"]
) -> Float[Tensor, "batch token width"]:
    """The tokens with `style` added to token 0."""
    return torch.cat([token[:, :1] + style[:, None], token[:, 1:]], dim=1)
