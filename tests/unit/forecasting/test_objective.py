from __future__ import annotations

import math

import torch

from stylesim.forecasting.head import Modes
from stylesim.forecasting.objective import SAME_M, mixture_loss, responsible_query, right_queries
from stylesim.forecasting.selection import selected_modes


def paths(ends: list[tuple[float, float]]) -> torch.Tensor:
    """Straight paths of 3 steps to these ends, as a batch of one."""
    return torch.tensor(ends)[None, :, None] * torch.tensor([1 / 3, 2 / 3, 1.0])[None, None, :, None]


def logit(probability: list[float]) -> torch.Tensor:
    return torch.tensor([probability]).log()


def test_the_first_mode_is_the_best_single_answer_and_what_ends_close_to_it_is_put_aside() -> None:
    ends = [(0.0, 0.0), (1.0, 0.0), (10.0, 0.0), (20.0, 0.0)]
    path, chance = selected_modes(paths(ends), logit([0.4, 0.3, 0.2, 0.1]), count=2, apart_m=2.5)
    # expected error of ending at 1 m: 0.4 + 0.2 x 9 + 0.1 x 19 = 4.1 m, less than at 0 m (4.3 m) or elsewhere;
    # of the two that are not put aside, 10 m leaves less than 20 m
    torch.testing.assert_close(path[0, :, -1], torch.tensor([[1.0, 0.0], [10.0, 0.0]]))
    seen = {near: math.exp(-0.5 * (near / 4.1) ** 2) for near in (0, 1, 9, 10, 19)}
    first = 0.4 * seen[1] + 0.3 + 0.2 * seen[9] + 0.1 * seen[19]
    second = 0.4 * seen[10] + 0.3 * seen[9] + 0.2 + 0.1 * seen[10]
    torch.testing.assert_close(chance, torch.tensor([[first, second]]) / (first + second))


def test_where_too_few_are_apart_the_best_put_aside_fill_up() -> None:
    ends = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (10.0, 0.0)]
    path, chance = selected_modes(paths(ends), logit([0.35, 0.05, 0.4, 0.2]), count=3, apart_m=2.5)
    assert sorted(path[0, :, -1, 0].tolist()) == [0.0, 2.0, 10.0]
    torch.testing.assert_close(chance.sum(), torch.tensor(1.0))


def test_the_middle_of_a_broad_crowd_is_more_probable_than_a_lone_path() -> None:
    ends = [(float(x), 0.0) for x in range(0, 40, 4)] + [(0.0, 60.0)]
    path, chance = selected_modes(paths(ends), logit([0.08] * 10 + [0.2]), count=6, apart_m=2.5)
    assert 8.0 <= path[0, 0, -1, 0] <= 28.0
    assert (path[0, :, -1, 1] == 60.0).any()
    assert chance[0, 0] > chance[0, path[0, :, -1, 1] == 60.0]


def test_equal_paths_are_equally_probable_and_none_is_taken_twice() -> None:
    path, chance = selected_modes(paths([(5.0, 0.0)] * 4), logit([0.4, 0.3, 0.2, 0.1]), count=3, apart_m=2.5)
    torch.testing.assert_close(chance, torch.full((1, 3), 1 / 3))
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


def test_intentions_that_are_alike_are_nearly_equally_right_and_more_so_along_than_across() -> None:
    anchor = paths([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (10.0, 0.0)])
    right = right_queries(anchor, paths([(0.0, 0.0)])[:, 0])
    torch.testing.assert_close(right.sum(dim=1), torch.ones(1))
    assert right[0, 0] > right[0, 1] > 0.9 * right[0, 0]
    assert 0.5 * right[0, 0] < right[0, 2] < right[0, 1]
    assert right[0, 3] < 1e-3


def test_the_loss_is_the_gaussian_likelihood_and_the_cross_entropy() -> None:
    anchor = paths([(0.0, 0.0), (10.0, 0.0)])
    future = paths([(10.0, 0.0)])[:, 0]
    sd = 2.0
    modes = Modes(anchor + 2.0, torch.full_like(anchor, math.log(sd)), logit([0.25, 0.75]))
    other = math.exp(-0.5 * (10.0 / SAME_M[0]) ** 2)
    cross_entropy = -(math.log(0.75) + other * math.log(0.25)) / (1 + other)
    expected = 0.5 * (2.0 / sd) ** 2 + math.log(sd) + cross_entropy
    torch.testing.assert_close(mixture_loss([modes, modes], anchor, future), torch.tensor([expected]))
