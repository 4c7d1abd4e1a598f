"""Dense prediction: the future of every agent around, learned beside the target's and looked at by its decoder.

As in MTR [recalled]: one path per agent from its token, given back to the token; here as what
it adds to constant velocity.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor, nn
from torch.nn import functional

from stylesim.forecasting.batching import Batch, to_target
from stylesim.forecasting.config import ModelConfig
from stylesim.forecasting.head import RESIDUAL_M
from stylesim.forecasting.layers import Perceptron
from stylesim.forecasting.store import SampleStore
from stylesim.forecasting.tensors import TensorBatch

KNOTS = 6  # points of the path that are given back; chosen: one a second for Argoverse 2's horizon
POSITION_SCALE = 0.05  # 20 m become 1, as in the network's inputs
LOSS_SCALE_M = 10.0  # an error of 10 m counts as much as one nat of the mixture; chosen: of the order of the first loss


class NeighbourFutures(nn.Module):
    """From the agents' tokens to a path each, and back to the tokens."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        steps = config.inputs.future_steps
        self.steps = steps
        self.path = Perceptron(config.width, 2 * config.width, 2 * steps)
        self.back = Perceptron(2 * KNOTS, config.width, config.width)
        time = torch.arange(1, steps + 1, dtype=torch.float32) * config.inputs.dt_s
        knots = torch.linspace(0, steps - 1, KNOTS).round().long()
        self.register_buffer("time_s", time[:, None], persistent=False)
        self.register_buffer("knots", knots, persistent=False)
        self.time_s: Tensor
        self.knots: Tensor

    def forward(
        self, token: Float[Tensor, "batch agent width"], batch: TensorBatch
    ) -> tuple[Float[Tensor, "batch agent width"], Float[Tensor, "batch agent time 2"]]:
        """The tokens, each knowing where its agent is expected to go; and the paths in the target's frame."""
        now = batch.agent[:, :, -1]  # [batch agent feature]
        straight = now[:, :, None, 0:2] + now[:, :, None, 2:4] * self.time_s
        added = self.path(token).unflatten(-1, (self.steps, 2))
        path = straight + RESIDUAL_M * self.time_s / self.time_s[-1] * added
        seen = POSITION_SCALE * path.detach()[:, :, self.knots].flatten(2)
        return token + self.back(seen), path


def neighbour_loss(
    path_m: Float[Tensor, "batch agent time 2"], truth_m: Float[Tensor, "batch agent time 2"]
) -> Float[Tensor, " batch"]:
    """Of each sample: the mean smooth L1 error (beta 1 m) of the agents around whose future is known, / LOSS_SCALE_M.

    Unknown futures are NaN; 0 where all are.
    """
    known = truth_m.isfinite()
    error = functional.smooth_l1_loss(path_m, torch.where(known, truth_m, path_m.detach()), reduction="none")
    count = known.sum(dim=(1, 2, 3)).clamp(min=1)
    return error.sum(dim=(1, 2, 3)) / (LOSS_SCALE_M * count)


def sample_of_agent(store: SampleStore) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """For every agent row of a store the sample that asks for its future, -1 where none does."""
    found = np.full(len(store.agent_pose), -1, np.int64)
    found[store.sample[:, 1]] = np.arange(len(store))
    return found


def neighbour_futures(
    store: SampleStore, batch: Batch, asked: np.ndarray[tuple[int], np.dtype[np.int64]]
) -> Float32[np.ndarray, "batch agent time 2"]:
    """The futures of the agents around in the frame of the target, itself left out; NaN where not known.

    Known are those of agents that are targets at the same t0 themselves: motor vehicles that are seen to the end.
    """
    sample = np.where(batch.agent_valid, asked[batch.agent_row], -1)
    sample[:, 0] = -1  # the target has a loss of its own
    future = np.asarray(store.future_m[np.maximum(sample, 0)])  # [batch agent time 2]
    moved = to_target(future - batch.pose[:, None, None, :2], batch.pose[:, 2])
    return np.where((sample >= 0)[..., None, None], moved, np.float32(np.nan))
