"""The network: agents and lanes become tokens, queries with an intention each become modes of the future.

In the spirit of MTR (intention queries, iterated decoder, Gaussian-mixture head) [recalled], small enough for two
cores.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from stylesim.forecasting.config import ModelConfig
from stylesim.forecasting.head import Head, Modes
from stylesim.forecasting.intentions import SPEED_EDGES_MPS
from stylesim.forecasting.layers import DecoderLayer, Perceptron, key_bias
from stylesim.forecasting.neighbours import NeighbourFutures
from stylesim.forecasting.scene_encoder import METRE, MPS, SceneEncoder, added_to_target
from stylesim.forecasting.selection import selected_queries
from stylesim.forecasting.style_vector import idle_parameters, style_module
from stylesim.forecasting.tensors import TensorBatch

# (z, k, c) with z < 0 for unknown; or a style vector, NaN for unknown
StyleTensor = Int[Tensor, "batch 3"] | Float[Tensor, "batch feature"]


@dataclass(frozen=True, eq=False)
class Encoded:
    """What the decoder looks at; `late` is the style where it enters there."""

    agent: Float[Tensor, "batch agent width"]
    piece: Float[Tensor, "batch piece 2*width"]  # keys and values
    bias: Float[Tensor, "batch 1 1 token"]  # which tokens exist, see `key_bias`
    late: Float[Tensor, "batch width"] | None
    neighbour_m: Float[Tensor, "batch agent time 2"] | None = None


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
                    end = head.mean(head.hidden(query), anchor[:, :, -1:])[:, :, 0]
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
        query, end, hidden = self._first_query(batch, encoded, anchor), None, None
        for number, head in enumerate(self.heads):
            assert isinstance(head, Head)
            query = self._decoded(number, query, encoded, end)
            hidden = head.hidden(query)
            end = head.mean(hidden, anchor[:, :, -1:])[:, :, 0]
        assert isinstance(head, Head) and end is not None and hidden is not None
        logit = head.log_odds(query)
        kept, chance = selected_queries(end, logit, count=self.config.modes, apart_m=self.config.nms_m)
        row = torch.arange(len(kept), device=kept.device)[:, None]
        return head.mean(hidden[row, kept], anchor[row, kept]), chance

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
