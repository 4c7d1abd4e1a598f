"""A `Batch` as tensors on one device."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from stylesim.forecasting.batching import Batch


@dataclass(frozen=True, eq=False)
class TensorBatch:
    """The inputs of the network; see `Batch`."""

    agent: Float[Tensor, "batch agent time 7"]
    agent_attribute: Float[Tensor, "batch agent 11"]
    piece: Float[Tensor, "batch piece point 2"]
    piece_attribute: Float[Tensor, "batch piece 14"]
    token_valid: Bool[Tensor, "batch token"]  # agents, then pieces

    @classmethod
    def of(cls, batch: Batch, device: torch.device | str = "cpu") -> TensorBatch:
        """That batch on that device."""
        valid = torch.cat([torch.from_numpy(batch.agent_valid), torch.from_numpy(batch.piece_valid)], dim=1)
        return cls(
            torch.from_numpy(batch.agent).to(device),
            torch.from_numpy(batch.agent_attribute).to(device),
            torch.from_numpy(batch.piece).to(device),
            torch.from_numpy(batch.piece_attribute).to(device),
            valid.to(device),
        )
