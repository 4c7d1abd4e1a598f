from __future__ import annotations

import numpy as np
import pytest
import torch

from stylesim.errors import InputError
from stylesim.forecasting.robust import RobustSettings
from stylesim.forecasting.weighing import GroupDRO, Mean, Weigher, WorstShare

LOSS = torch.tensor([1.0, 4.0, 2.0, 3.0])
GROUP = torch.tensor([0, 1, 0, 0])


def test_the_mean_and_the_worst_share() -> None:
    assert float(Mean()(LOSS, None)) == 2.5
    assert float(WorstShare(0.5)(LOSS, None)) == 3.5
    assert float(WorstShare(0.3)(LOSS, None)) == 3.5  # of four, at least two are the worst 30 %
    assert float(WorstShare(1.0)(LOSS, None)) == 2.5


def test_group_weights_follow_the_published_update() -> None:
    dro = GroupDRO(np.array([0.75, 0.25]), step=0.1, memory=0.5)
    value = dro(LOSS, GROUP)
    q = np.exp(0.1 * np.array([2.0, 4.0]))  # from equal weights, times exp(step x mean loss of the group)
    q /= q.sum()
    np.testing.assert_allclose(dro.q.numpy(), q, rtol=1e-6)
    # each group was drawn as often as its share says, so the value is sum of q x mean loss
    assert float(value) == pytest.approx(q @ [2.0, 4.0], rel=1e-6)
    dro(torch.tensor([10.0]), torch.tensor([0]))  # the second group is not in this batch: its last loss holds
    q *= np.exp(0.1 * np.array([0.5 * 2.0 + 0.5 * 10.0, 4.0]))
    np.testing.assert_allclose(dro.q.numpy(), q / q.sum(), rtol=1e-6)


def test_weights_move_to_the_worst_group_and_stay_a_distribution() -> None:
    dro = GroupDRO(np.array([0.5, 0.3, 0.2, 0.0]), step=0.05, memory=0.1)
    group = torch.tensor([0, 0, 0, 1, 1, 2])
    for _ in range(200):
        dro(torch.tensor([0.1, 0.1, 0.1, 0.2, 0.2, 1.5]), group)
    assert float(dro.q.sum()) == pytest.approx(1.0, abs=1e-5)
    assert int(dro.q.argmax()) == 2
    assert float(dro.q[2]) > 0.9
    assert float(dro.q[3]) == 0.0  # a group that is never drawn takes no weight


def test_a_group_that_was_not_seen_moves_with_the_others() -> None:
    dro = GroupDRO(np.full(3, 1 / 3), step=0.1, memory=0.1)
    dro(torch.tensor([1.0, 3.0]), torch.tensor([0, 1]))
    assert dro.q[0] < dro.q[2] < dro.q[1]


def test_a_resumed_state_goes_on_with_the_same_bits() -> None:
    straight = GroupDRO(np.array([0.75, 0.25]), step=0.1, memory=0.5)
    straight(LOSS, GROUP)
    resumed = GroupDRO(np.array([0.75, 0.25]), step=0.1, memory=0.5)
    resumed.restore(straight.state())
    assert float(resumed(LOSS + 1, GROUP)) == float(straight(LOSS + 1, GROUP))
    assert torch.equal(resumed.q, straight.q)


def fitted(weigher: Weigher, *, rare: float = 0.1, balanced: bool = False) -> tuple[float, float]:
    """Losses of two groups after a common number was learned: most want 0, the rare ones 1."""
    rng = np.random.default_rng(0)
    theta = torch.tensor(0.3, requires_grad=True)
    for _ in range(1500):
        group = torch.from_numpy((rng.random(32) < (0.5 if balanced else rare)).astype(np.int64))
        loss = weigher((theta - group).square(), group)
        (gradient,) = torch.autograd.grad(loss, theta)
        theta = (theta - 0.05 * gradient).detach().requires_grad_()
    value = float(theta.detach())
    return value**2, (1 - value) ** 2


def test_the_rare_group_gains_where_the_mean_neglects_it() -> None:
    common, rare = fitted(Mean())
    assert rare > 10 * common
    for weigher, balanced in (
        (GroupDRO(np.array([0.9, 0.1]), step=0.05, memory=0.1), False),
        (GroupDRO(np.array([0.5, 0.5]), step=0.05, memory=0.1), True),
        (Mean(), True),
    ):
        assert max(fitted(weigher, balanced=balanced)) < 0.4  # 0.25 where both are equally bad
    assert max(fitted(WorstShare(0.2))) < rare - 0.2  # without knowing the groups


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ("group_dor", "Did you mean 'group_dro'"),
        ("group_dro,cvar", "choose one"),
        (("jtt", "jtt"), "once"),
    ],
)
def test_what_cannot_be_combined_is_refused(asked: str | tuple[str, ...], text: str) -> None:
    with pytest.raises(InputError, match=text):
        RobustSettings.of(asked)


def test_settings_out_of_range_are_named() -> None:
    for changes in ({"by": "mdsi"}, {"jtt_share": 0.0}, {"cvar_share": 1.1}, {"jtt_weight": 0.5}, {"dro_step": -1.0}):
        with pytest.raises(InputError, match=next(iter(changes)) if "by" not in changes else "style method"):
            RobustSettings(**changes)  # type: ignore[arg-type]


def test_names_in_text_or_sequence() -> None:
    assert RobustSettings.of("none").methods == RobustSettings.of(()).methods == ()
    assert RobustSettings.of("balanced, jtt") == RobustSettings.of(["balanced", "jtt"])
    assert RobustSettings.of("balanced").grouped
    assert not RobustSettings.of("jtt,cvar").grouped
