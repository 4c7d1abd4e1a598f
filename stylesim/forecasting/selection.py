"""How many queries become few modes."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int
from torch import Tensor


def selected_queries(
    end_m: Float[Tensor, "batch query 2"], logit: Float[Tensor, "batch query"], *, count: int, apart_m: float
) -> tuple[Int[Tensor, "batch mode"], Float[Tensor, "batch mode"]]:
    """The `count` queries that are kept as modes, most probable first, and their probabilities (sum 1).

    Non-maximum suppression: take the most probable path, put aside those that end nearer than `apart_m` to it, go
    on; where too few are left, the most probable of those put aside. The probability of what is not kept goes to
    the kept mode that ends nearest [ours; MTR renormalises], so that no mass is lost.
    """
    probability = logit.softmax(dim=1)
    distance = torch.cdist(end_m, end_m, compute_mode="donot_use_mm_for_euclid_dist")  # [batch query query]
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
    return kept, mass / mass.sum(dim=1, keepdim=True)


def selected_modes(
    path_m: Float[Tensor, "batch query time 2"], logit: Float[Tensor, "batch query"], *, count: int, apart_m: float
) -> tuple[Float[Tensor, "batch mode time 2"], Float[Tensor, "batch mode"]]:
    """The paths of `selected_queries`, and their probabilities."""
    kept, chance = selected_queries(path_m[:, :, -1], logit, count=count, apart_m=apart_m)
    row = torch.arange(len(logit), device=logit.device)[:, None]
    return path_m[row, kept], chance
