"""The network: agents and lanes become tokens, queries with an intention each become modes of the future.

In the spirit of MTR (intention queries, iterated decoder, Gaussian-mixture head) [recalled], small enough for two
cores.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from stylesim.forecasting.batching import AGENT_ATTRIBUTES, AGENT_FEATURES, PIECE_ATTRIBUTES
from stylesim.forecasting.config import ModelConfig
from stylesim.forecasting.head import Head, Modes
from stylesim.forecasting.intentions import SPEED_EDGES_MPS
from stylesim.forecasting.layers import DecoderLayer, EncoderLayer, PatchEncoder, Perceptron, key_bias, scale
from stylesim.forecasting.neighbours import NeighbourFutures
from stylesim.forecasting.selection import selected_queries
from stylesim.forecasting.style_vector import idle_parameters, style_module
from stylesim.forecasting.tensors import TensorBatch

# (z, k, c) with z < 0 for unknown; or a style vector, NaN for unknown
StyleTensor = Int[Tensor, "batch 3"] | Float[Tensor, "batch feature"]
METRE, MPS, SECOND = 0.05, 0.1, 0.2  # features of 20 m, 10 m/s, 5 s become 1


@dataclass(frozen=True, eq=False)
class Encoded:
    """What the decoder looks at; `late` is the style where it enters there."""

    agent: Float[Tensor, "batch agent width"]
    piece: Float[Tensor, "batch piece 2*width"]  # keys and values
    bias: Float[Tensor, "batch 1 1 token"]  # which tokens exist, see `key_bias`
    late: Float[Tensor, "batch width"] | None
    neighbour_m: Float[Tensor, "batch agent time 2"] | None = None


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


class ForecastNetwork(nn.Module):
    """Encoder, intention queries, decoder. `intention_mps2` holds the queries' mean accelerations by speed group."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        width, inputs = config.width, config.inputs
        self.encoder = SceneEncoder(config)
        self.intention = Perceptron(4, width, width)
        self.revision = Perceptron(2, width, width)
        self.layers = nn.ModuleList(
            DecoderLayer(width, config.heads, config.dropout) for _ in range(config.decoder_layers)
        )
        self.heads = nn.ModuleList(Head(config) for _ in range(config.decoder_layers))
        self.neighbours = NeighbourFutures(config) if config.dense else None
        self.style = style_module(config)  # last, so that the rest starts alike with and without it
        self.register_parameter("idle", idle_parameters(config, self.style))
        self.register_buffer("intention_mps2", torch.zeros(len(SPEED_EDGES_MPS) + 1, config.queries, 2))
        self.register_buffer("speed_edges", torch.tensor(SPEED_EDGES_MPS), persistent=False)
        time = torch.arange(1, inputs.future_steps + 1, dtype=torch.float32) * inputs.dt_s
        self.register_buffer("time_s", time[:, None], persistent=False)
        self.intention_mps2: Tensor
        self.speed_edges: Tensor
        self.time_s: Tensor

    def anchors(self, batch: TensorBatch) -> Float[Tensor, "batch query time 2"]:
        """The path of each intention: the velocity of t0 and a constant acceleration, one set per speed group."""
        velocity = batch.agent[:, 0, -1, 2:4]  # [batch 2]
        group = torch.bucketize(velocity.norm(dim=-1), self.speed_edges, right=True)
        acceleration = self.intention_mps2[group][:, :, None]  # [batch query 1 2]
        return velocity[:, None, None] * self.time_s + 0.5 * acceleration * self.time_s**2

    def forward(
        self,
        batch: TensorBatch,
        style: StyleTensor | None = None,
        learner: Int[Tensor, " batch"] | None = None,
    ) -> list[Modes]:
        """The mixture after every decoder layer, the last one best. Rows of `style`: see `StyleTensor`.

        `learner` names the query of each sample whose path is wanted, where that is one only: in training.
        """
        anchor = self.anchors(batch)
        encoded = self._encoded(batch, style)
        query = self._first_query(batch, encoded, anchor)
        modes: list[Modes] = []
        end = None
        for number, head in enumerate(self.heads):
            assert isinstance(head, Head)
            query = self._decoded(number, query, encoded, end)
            modes.append(head(query, anchor, learner))
            if len(modes) < len(self.heads):
                with torch.no_grad():
                    end = head.mean(query, anchor[:, :, -1:])[:, :, 0]
        modes[-1] = replace(modes[-1], neighbour_m=encoded.neighbour_m)
        return modes

    def predict(
        self, batch: TensorBatch, style: StyleTensor | None = None
    ) -> tuple[Float[Tensor, "batch mode time 2"], Float[Tensor, "batch mode"]]:
        """The modes that are kept (`selected_queries`), most probable first, and their probabilities.

        What `forward` and a selection from its last mixture give; but the heads compute only what is asked for:
        the ends of all queries, the whole paths of the modes that are kept.
        """
        anchor = self.anchors(batch)
        encoded = self._encoded(batch, style)
        query, end = self._first_query(batch, encoded, anchor), None
        for number, head in enumerate(self.heads):
            assert isinstance(head, Head)
            query = self._decoded(number, query, encoded, end)
            end = head.mean(query, anchor[:, :, -1:])[:, :, 0]
        assert isinstance(head, Head) and end is not None
        logit = head.log_odds(query)
        kept, chance = selected_queries(end, logit, count=self.config.modes, apart_m=self.config.nms_m)
        row = torch.arange(len(kept), device=kept.device)[:, None]
        return head.mean(query[row, kept], anchor[row, kept]), chance

    def _encoded(self, batch: TensorBatch, style: StyleTensor | None) -> Encoded:
        embedding = None
        if self.style is not None:
            given = self.style.unknown(len(batch.agent), batch.agent.device) if style is None else style
            embedding = self.style(given)  # [batch width]
        fusion = self.config.fusion if embedding is not None else "none"
        bias = key_bias(batch.token_valid)
        agent, piece = self.encoder(batch, bias, embedding if fusion == "early" else None)
        if fusion == "mid" and embedding is not None:
            agent = added_to_target(agent, embedding)
        neighbour = None
        if self.neighbours is not None:
            agent, neighbour = self.neighbours(agent, batch)
        return Encoded(agent, piece, bias, embedding if fusion == "late" else None, neighbour)

    def _first_query(
        self, batch: TensorBatch, encoded: Encoded, anchor: Float[Tensor, "batch query time 2"]
    ) -> Float[Tensor, "batch query width"]:
        velocity = MPS * batch.agent[:, 0, -1, 2:4]
        intention = torch.cat([METRE * anchor[:, :, -1], velocity[:, None].expand(-1, anchor.shape[1], -1)], dim=-1)
        query: Tensor = encoded.agent[:, :1] + self.intention(intention)
        return query

    def _decoded(
        self,
        number: int,
        query: Float[Tensor, "batch query width"],
        encoded: Encoded,
        end: Float[Tensor, "batch query 2"] | None,
    ) -> Float[Tensor, "batch query width"]:
        """The queries after that decoder layer; `end` is where the previous one saw them end."""
        if end is not None:
            query = query + self.revision(METRE * end)
        if encoded.late is not None:
            query = query + encoded.late[:, None]
        decoded: Tensor = self.layers[number](query, encoded.agent, encoded.piece, encoded.bias)
        return decoded
