from __future__ import annotations

import pytest
import torch
from torch import Tensor, nn

from stylesim.errors import InputError
from stylesim.forecasting.config import READINGS
from stylesim.forecasting.style_embedding import StyleContextEmbedding, style_parameter_groups

CELLS = torch.tensor([[0, 0, 0], [5, 2, 1], [-1, -1, -1], [3, 1, 0]])


def made(reading: str = "R1", dropout: float = 0.0) -> StyleContextEmbedding:
    torch.manual_seed(0)
    return StyleContextEmbedding(styles=6, width=32, reading=reading, rank=3, dropout=dropout)


@pytest.mark.parametrize("reading", READINGS)
def test_every_reading_gives_one_vector_per_driver_and_zero_for_unknown_style(reading: str) -> None:
    vector = made(reading)(CELLS)
    assert vector.shape == (4, 32)
    assert (vector[2] == 0).all()
    assert (vector[[0, 1, 3]].norm(dim=1) > 0.01).all()


def test_r1_is_the_product_of_cluster_and_context() -> None:
    layer = made("R1")
    layer.w.data.normal_()
    torch.testing.assert_close(layer(CELLS)[1], layer.u[5, 2, 0] * layer.w[5, 1, 0])


def test_r3_is_a_number_times_one_direction() -> None:
    layer = made("R3")
    vector = layer(CELLS)
    alpha = (layer.u[5, 2] * layer.w[5, 1]).sum()
    torch.testing.assert_close(vector[1], alpha * layer.v)
    ratio = vector[0] / vector[1]
    torch.testing.assert_close(ratio, ratio[:1].expand(32))


def test_r4_adds_and_r5_looks_up() -> None:
    added, table = made("R4"), made("R5")
    added.w.data.normal_()
    torch.testing.assert_close(added(CELLS)[3], added.u[3, 1, 0] + added.w[3, 0, 0])
    torch.testing.assert_close(table(CELLS)[3], table.u[3, 1, 0])


@pytest.mark.parametrize("reading", ["R1", "R2", "R4", "R5"])
def test_vectors_start_at_length_one(reading: str) -> None:
    torch.manual_seed(0)
    layer = StyleContextEmbedding(styles=6, width=256, reading=reading, dropout=0.0)
    cells = torch.cartesian_prod(torch.arange(6), torch.arange(3), torch.arange(2))
    assert 0.9 < layer(cells).norm(dim=1).mean().item() < 1.1


def test_dropout_gives_the_null_token_in_training_only() -> None:
    layer = made(dropout=0.15)
    known = CELLS[:1].expand(4000, 3)
    share = float((layer.train()(known) == 0).all(dim=1).float().mean())
    assert 0.12 < share < 0.18
    assert not (layer.eval()(known) == 0).all(dim=1).any()


def test_it_goes_into_a_network_that_is_not_ours_and_learns_faster_without_decay() -> None:
    class Foreign(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.encoder = nn.Linear(8, 32)
            self.style = StyleContextEmbedding(styles=6, width=32)

        def forward(self, x: Tensor, style: Tensor) -> Tensor:
            return self.encoder(x) + self.style(style)

    model = Foreign()
    assert model(torch.randn(4, 8), CELLS).shape == (4, 32)
    groups = style_parameter_groups(model, lr=1e-3, weight_decay=0.1)
    assert sum(len(g["params"]) for g in groups) == len(list(model.parameters()))
    by_id = {id(p): g for g in groups for p in g["params"]}
    assert by_id[id(model.style.u)]["weight_decay"] == 0
    assert by_id[id(model.style.u)]["lr"] > by_id[id(model.encoder.weight)]["lr"]
    assert by_id[id(model.encoder.weight)]["weight_decay"] == 0.1
    assert by_id[id(model.encoder.bias)]["weight_decay"] == 0


def test_wrong_settings_are_refused() -> None:
    with pytest.raises(InputError, match="R9"):
        StyleContextEmbedding(styles=6, width=8, reading="R9")
    with pytest.raises(InputError, match="dropout"):
        StyleContextEmbedding(styles=6, width=8, dropout=1.0)
    with pytest.raises(InputError, match="1 or more"):
        StyleContextEmbedding(styles=0, width=8)
