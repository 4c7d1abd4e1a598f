"""What is learned."""

from __future__ import annotations

from collections.abc import Sequence

from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional

from stylesim.forecasting.head import Modes


def responsible_query(
    anchor_m: Float[Tensor, "batch query time 2"], future_m: Float[Tensor, "batch time 2"]
) -> Int[Tensor, " batch"]:
    """The query whose intention ends nearest to where the agent went; only it learns the path.

    By intention and not by prediction, so that no query can die or take all (MTR) [recalled].
    """
    gap = anchor_m[:, :, -1] - future_m[:, None, -1]
    return gap.square().sum(dim=-1).argmin(dim=1)


def mixture_loss(
    layers: Sequence[Modes], anchor_m: Float[Tensor, "batch query time 2"], future_m: Float[Tensor, "batch time 2"]
) -> Float[Tensor, " batch"]:
    """Of each sample: mean over decoder layers of the responsible query's Gaussian -log likelihood + cross-entropy.

    In nats; the likelihood is averaged over time steps and coordinates.
    """
    query = responsible_query(anchor_m, future_m)
    total = future_m.new_zeros(len(query))
    for modes in layers:
        mean, log_sd = modes.path_of(query)
        error = (future_m - mean) / log_sd.exp()
        likelihood = (0.5 * error.square() + log_sd).mean(dim=(1, 2))
        total = total + likelihood + functional.cross_entropy(modes.logit, query, reduction="none")
    return total / len(layers)
