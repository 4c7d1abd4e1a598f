from __future__ import annotations

import math

import torch

from stylesim.forecasting.head import Modes
from stylesim.forecasting.objective import mixture_loss, responsible_query
from stylesim.forecasting.selection import selected_modes


def paths(ends: list[tuple[float, float]]) -> torch.Tensor:
    """Straight paths of 3 steps to these ends, as a batch of one."""
    return torch.tensor(ends)[None, :, None] * torch.tensor([1 / 3, 2 / 3, 1.0])[None, None, :, None]


def logit(probability: list[float]) -> torch.Tensor:
    return torch.tensor([probability]).log()


def test_paths_that_end_close_to_a_better_one_are_put_aside() -> None:
    ends = [(0.0, 0.0), (1.0, 0.0), (10.0, 0.0), (20.0, 0.0)]
    path, chance = selected_modes(paths(ends), logit([0.4, 0.3, 0.2, 0.1]), count=2, apart_m=2.5)
    torch.testing.assert_close(path[0, :, -1], torch.tensor([[0.0, 0.0], [10.0, 0.0]]))
    # the second's mass goes to the first, the fourth's to the third, its nearest
    torch.testing.assert_close(chance, torch.tensor([[0.7, 0.3]]))


def test_where_too_few_are_apart_the_most_probable_put_aside_fill_up() -> None:
    ends = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (10.0, 0.0)]
    path, chance = selected_modes(paths(ends), logit([0.4, 0.1, 0.3, 0.2]), count=3, apart_m=2.5)
    assert sorted(path[0, :, -1, 0].tolist()) == [0.0, 2.0, 10.0]
    torch.testing.assert_close(chance.sum(), torch.tensor(1.0))


def test_equal_paths_keep_their_own_mass_and_none_is_taken_twice() -> None:
    path, chance = selected_modes(paths([(5.0, 0.0)] * 4), logit([0.4, 0.3, 0.2, 0.1]), count=3, apart_m=2.5)
    torch.testing.assert_close(chance, torch.tensor([[0.5, 0.3, 0.2]]), atol=1e-6, rtol=0)
    assert path.shape == (1, 3, 3, 2)


def test_modes_come_most_probable_first() -> None:
    torch.manual_seed(0)
    path, chance = selected_modes(torch.randn(5, 16, 4, 2) * 20, torch.randn(5, 16), count=6, apart_m=2.5)
    assert path.shape == (5, 6, 4, 2)
    assert (chance.diff(dim=1) <= 0).all()
    torch.testing.assert_close(chance.sum(dim=1), torch.ones(5))


def test_the_query_with_the_nearest_intention_is_responsible() -> None:
    anchor = paths([(0.0, 0.0), (10.0, 0.0), (0.0, 10.0)])
    future = paths([(2.0, 9.0)])[:, 0]
    assert responsible_query(anchor, future).tolist() == [2]


def test_the_loss_is_the_gaussian_likelihood_and_the_cross_entropy() -> None:
    anchor = paths([(0.0, 0.0), (10.0, 0.0)])
    future = paths([(10.0, 0.0)])[:, 0]
    sd = 2.0
    modes = Modes(anchor + 2.0, torch.full_like(anchor, math.log(sd)), logit([0.25, 0.75]))
    expected = 0.5 * (2.0 / sd) ** 2 + math.log(sd) - math.log(0.75)
    torch.testing.assert_close(mixture_loss([modes, modes], anchor, future), torch.tensor([expected]))
