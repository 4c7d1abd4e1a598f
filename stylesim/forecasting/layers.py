"""The small parts of the network: perceptron, attention, encoder and decoder layer. Pre-norm throughout."""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn import functional


class Perceptron(nn.Sequential):
    """Two linear layers with a GELU between them."""

    def __init__(self, inputs: int, hidden: int, outputs: int) -> None:
        super().__init__(nn.Linear(inputs, hidden), nn.GELU(), nn.Linear(hidden, outputs))


class Attention(nn.Module):
    """Multi-head attention of queries to keys and values, which `key_value` makes of tokens (or another layer has)."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.query = nn.Linear(width, width)
        self.key_value = nn.Linear(width, 2 * width)
        self.out = nn.Linear(width, width)

    def forward(
        self,
        query: Float[Tensor, "batch query width"],
        key_value: Float[Tensor, "batch key 2*width"],
        bias: Float[Tensor, "batch 1 1 key"] | None,
    ) -> Float[Tensor, "batch query width"]:
        """What each query gathers; `bias` is 0 for keys that exist, -inf else (`key_bias`)."""
        split = (self.heads, query.shape[2] // self.heads)
        q = self.query(query).unflatten(-1, split).transpose(1, 2)  # [batch head query width/head]
        both = key_value.reshape(*key_value.shape[:2], 2, *split)  # [batch key 2 head width/head]
        k, v = both.permute(2, 0, 3, 1, 4)  # each [batch head key width/head]
        gathered = functional.scaled_dot_product_attention(q, k, v, attn_mask=bias)
        out: Tensor = self.out(gathered.transpose(1, 2).flatten(2))
        return out


def key_bias(valid: Bool[Tensor, "batch key"]) -> Float[Tensor, "batch 1 1 key"]:
    """What attention adds: 0 for keys that exist (one per sample must), -inf for those that do not."""
    return torch.zeros(valid.shape, device=valid.device).masked_fill(~valid, -torch.inf)[:, None, None]


class EncoderLayer(nn.Module):
    """Agents look at each other and at the lanes, then a perceptron. Lanes look at nobody.

    What a lane piece is does not depend on who drives there, and pieces are four fifths of the tokens: with
    self-attention over all of them a training step takes about twice as long.
    """

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.norm1, self.norm2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.attention = Attention(width, heads)
        self.mlp = Perceptron(width, 2 * width, width)
        self.dropout = nn.Dropout(dropout)

    def forward(
        self,
        agent: Float[Tensor, "batch agent width"],
        piece: Float[Tensor, "batch piece 2*width"],
        bias: Float[Tensor, "batch 1 1 token"],
    ) -> Float[Tensor, "batch agent width"]:
        """The agents, each knowing of the others and of the lanes, whose keys and values are `piece`."""
        x = self.norm1(agent)
        key_value = torch.cat([self.attention.key_value(x), piece], dim=1)
        agent = agent + self.dropout(self.attention(x, key_value, bias))
        return agent + self.dropout(self.mlp(self.norm2(agent)))


class DecoderLayer(nn.Module):
    """Queries look at each other, then at the scene, then a perceptron."""

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.norm1, self.norm2, self.norm3 = nn.LayerNorm(width), nn.LayerNorm(width), nn.LayerNorm(width)
        self.among, self.across = Attention(width, heads), Attention(width, heads)
        self.mlp = Perceptron(width, 4 * width, width)  # wider than the encoder's: queries are few, so it costs little
        self.dropout = nn.Dropout(dropout)

    def forward(
        self,
        query: Float[Tensor, "batch query width"],
        agent: Float[Tensor, "batch agent width"],
        piece: Float[Tensor, "batch piece 2*width"],
        bias: Float[Tensor, "batch 1 1 token"],
    ) -> Float[Tensor, "batch query width"]:
        """The queries, each knowing of the others, of the agents, and of the lanes (`piece`: keys and values)."""
        x = self.norm1(query)
        query = query + self.dropout(self.among(x, self.among.key_value(x), None))
        key_value = torch.cat([self.across.key_value(agent), piece], dim=1)
        query = query + self.dropout(self.across(self.norm2(query), key_value, bias))
        return query + self.dropout(self.mlp(self.norm3(query)))


class PatchEncoder(nn.Module):
    """A history of any fixed length as one token: patches of a few steps, a layer each, then a perceptron over all."""

    def __init__(self, *, steps: int, features: int, patch: int, width: int) -> None:
        super().__init__()
        self.patches, self.patch = -(-steps // patch), patch
        self.of_patch = nn.Linear(patch * features, width // 2)
        self.of_all = Perceptron(self.patches * (width // 2), width, width)

    def forward(self, history: Float[Tensor, "batch agent time feature"]) -> Float[Tensor, "batch agent width"]:
        """One token per agent; missing steps are zeros, and their `valid` feature says so."""
        padding = self.patches * self.patch - history.shape[2]
        padded = functional.pad(history, (0, 0, padding, 0))  # on the left: t0 keeps its place
        patched = padded.reshape(
            *padded.shape[:2], self.patches, self.patch * padded.shape[3]
        )  # [batch agent patch patch*feature]
        token: Tensor = self.of_all(functional.gelu(self.of_patch(patched)).flatten(2))
        return token


def scale(values: list[float]) -> Tensor:
    """A constant vector of factors that bring features to the order of 1."""
    return torch.tensor(values, dtype=torch.float32)
