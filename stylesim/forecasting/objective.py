"""What is learned, and how many queries become few modes."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional

from stylesim.forecasting.model import Modes


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
) -> Float[Tensor, ""]:
    """Mean over decoder layers of: Gaussian negative log-likelihood of the responsible query + its cross-entropy.

    In nats; the likelihood is averaged over time steps and coordinates.
    """
    query = responsible_query(anchor_m, future_m)
    row = torch.arange(len(query), device=query.device)
    total = future_m.new_zeros(())
    for modes in layers:
        log_sd = modes.log_sd[row, query]
        error = (future_m - modes.mean_m[row, query]) / log_sd.exp()
        likelihood = (0.5 * error.square() + log_sd).mean()
        total = total + likelihood + functional.cross_entropy(modes.logit, query)
    return total / len(layers)


def selected_modes(
    path_m: Float[Tensor, "batch query time 2"], logit: Float[Tensor, "batch query"], *, count: int, apart_m: float
) -> tuple[Float[Tensor, "batch mode time 2"], Float[Tensor, "batch mode"]]:
    """The `count` modes that are kept, most probable first, and their probabilities (sum 1).

    Non-maximum suppression: take the most probable path, put aside those that end nearer than `apart_m` to it, go
    on; where too few are left, the most probable of those put aside. The probability of what is not kept goes to
    the kept mode that ends nearest [ours; MTR renormalises], so that no mass is lost.
    """
    probability = logit.softmax(dim=1)
    end = path_m[:, :, -1]
    distance = torch.cdist(end, end, compute_mode="donot_use_mm_for_euclid_dist")  # [batch query query]
    row = torch.arange(len(logit), device=logit.device)
    rank = probability.clone()
    chosen = []
    for _ in range(count):
        best = rank.argmax(dim=1)
        chosen.append(best)
        near = distance[row, best] < apart_m
        # put aside: below every path that was not, but still in order of probability (all are in [0, 1])
        rank = torch.where(near & (rank >= 0), rank - 2.0, rank)
        rank[row, best] = -torch.inf
    kept = torch.stack(chosen, dim=1)  # [batch mode]
    to_kept = distance.gather(2, kept[:, None].expand(-1, distance.shape[1], -1))  # [batch query mode]
    # a kept mode keeps its own mass even where two ends coincide
    owner = to_kept.argmin(dim=2).scatter(1, kept, torch.arange(count, device=logit.device).expand_as(kept))
    mass = torch.zeros_like(kept, dtype=probability.dtype).scatter_add(1, owner, probability)
    order = mass.argsort(dim=1, descending=True, stable=True)
    kept, mass = kept.gather(1, order), mass.gather(1, order)
    return path_m[row[:, None], kept], mass / mass.sum(dim=1, keepdim=True)
