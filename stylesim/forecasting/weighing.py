"""From the losses of a batch to the one number that is minimised: the mean, GroupDRO, or the worst share."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor


@runtime_checkable
class Weigher(Protocol):
    """What the loop minimises."""

    def __call__(self, loss: Float[Tensor, " batch"], group: Int64[Tensor, " batch"] | None) -> Float[Tensor, ""]:
        """One number, from the loss of each sample and the number of its group."""
        ...

    def state(self) -> dict[str, Tensor]:
        """What it has learned so far, for the checkpoint."""
        ...

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Go on from such a state."""
        ...


class Mean:
    """Every sample counts the same."""

    def __call__(self, loss: Float[Tensor, " batch"], group: Int64[Tensor, " batch"] | None) -> Float[Tensor, ""]:
        """The mean."""
        return loss.mean()

    def state(self) -> dict[str, Tensor]:
        """Nothing."""
        return {}

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Nothing to restore."""


class WorstShare(Mean):
    """Conditional value at risk: the mean of the greatest losses of the batch (Levy et al. 2020, batch estimator)."""

    def __init__(self, share: float) -> None:
        self.share = share

    def __call__(self, loss: Float[Tensor, " batch"], group: Int64[Tensor, " batch"] | None) -> Float[Tensor, ""]:
        """Mean of the greatest ceil(share x batch) losses."""
        return loss.topk(math.ceil(self.share * len(loss))).values.mean()


class GroupDRO:
    """Weights q of groups that follow exp(step x loss) (Sagawa et al. 2020, algorithm 1).

    The loss of a group is a running mean over batches, because a batch of 32 does not show all groups. A sample
    weighs q / (how often its group is drawn), so that the gradient is the one of sum_g q_g loss_g however the samples
    are drawn.
    """

    def __init__(self, share: Float64[np.ndarray, " group"], *, step: float, memory: float) -> None:
        """`share`: how often each group is drawn; sums to 1."""
        self.share = torch.from_numpy(share.astype(np.float32))
        self.step, self.memory = step, memory
        self.log_q = torch.where(self.share > 0, 0.0, -torch.inf).log_softmax(dim=0)  # one that is not drawn: 0
        self.loss = torch.full((len(share),), torch.nan)  # running mean; NaN until a group is seen

    @property
    def q(self) -> Float[Tensor, " group"]:
        """The weights; sum 1."""
        return self.log_q.exp()

    def __call__(self, loss: Float[Tensor, " batch"], group: Int64[Tensor, " batch"] | None) -> Float[Tensor, ""]:
        """Update the weights by this batch, then the weighted mean of its losses."""
        if group is None:
            raise ValueError("GroupDRO needs the group of each sample")
        at = group.cpu()
        self._update(loss.detach().float().cpu(), at)
        weight = (self.q / self.share)[at].to(loss.device, loss.dtype)
        return (weight * loss).mean()

    def _update(self, loss: Float[Tensor, " batch"], group: Int64[Tensor, " batch"]) -> None:
        count = torch.zeros_like(self.loss).index_add_(0, group, torch.ones_like(loss))
        mean = torch.zeros_like(self.loss).index_add_(0, group, loss) / count.clamp(min=1)
        moved = torch.where(self.loss.isnan(), mean, torch.lerp(self.loss, mean, self.memory))
        self.loss = torch.where(count > 0, moved, self.loss)
        seen = self.loss.isfinite()
        # a group that was not seen yet moves as the mean of the others
        pull = torch.where(seen, self.loss, self.loss[seen].mean())
        self.log_q = torch.log_softmax(self.log_q + self.step * pull, dim=0)

    def state(self) -> dict[str, Tensor]:
        """The weights and running losses."""
        return {"log_q": self.log_q, "loss": self.loss}

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Go on from such a state."""
        self.log_q, self.loss = state["log_q"].clone(), state["loss"].clone()
