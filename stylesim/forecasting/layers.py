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
    """Multi-head attention of queries to keys; `valid` says which keys exist (at least one per sample must)."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.query = nn.Linear(width, width)
        self.key_value = nn.Linear(width, 2 * width)
        self.out = nn.Linear(width, width)

    def forward(
        self,
        query: Float[Tensor, "batch query width"],
        key: Float[Tensor, "batch key width"],
        valid: Bool[Tensor, "batch key"] | None,
    ) -> Float[Tensor, "batch query width"]:
        """What each query gathers."""
        split = (self.heads, -1)
        q = self.query(query).unflatten(-1, split).transpose(1, 2)  # [batch head query width/head]
        k, v = self.key_value(key).unflatten(-1, (2, *split)).permute(2, 0, 3, 1, 4)  # each [batch head key width/head]
        mask = None if valid is None else valid[:, None, None]
        gathered = functional.scaled_dot_product_attention(q, k, v, attn_mask=mask)
        out: Tensor = self.out(gathered.transpose(1, 2).flatten(2))
        return out


class EncoderLayer(nn.Module):
    """Self-attention over the tokens of a scene, then a perceptron."""

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.norm1, self.norm2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.attention = Attention(width, heads)
        self.mlp = Perceptron(width, 2 * width, width)
        self.dropout = nn.Dropout(dropout)

    def forward(
        self, token: Float[Tensor, "batch token width"], valid: Bool[Tensor, "batch token"]
    ) -> Float[Tensor, "batch token width"]:
        """The tokens, each knowing of the others."""
        x = self.norm1(token)
        token = token + self.dropout(self.attention(x, x, valid))
        return token + self.dropout(self.mlp(self.norm2(token)))


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
        scene: Float[Tensor, "batch token width"],
        valid: Bool[Tensor, "batch token"],
    ) -> Float[Tensor, "batch query width"]:
        """The queries, each knowing of the others and of the scene."""
        x = self.norm1(query)
        query = query + self.dropout(self.among(x, x, None))
        query = query + self.dropout(self.across(self.norm2(query), scene, valid))
        return query + self.dropout(self.mlp(self.norm3(query)))


class PatchEncoder(nn.Module):
    """A history of any fixed length as one token: patches of a few steps, a perceptron each, then one over all."""

    def __init__(self, *, steps: int, features: int, patch: int, width: int) -> None:
        super().__init__()
        self.patches, self.patch = -(-steps // patch), patch
        self.of_patch = Perceptron(patch * features, width, width // 2)
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
