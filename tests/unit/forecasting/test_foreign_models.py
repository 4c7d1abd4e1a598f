"""`StyleContextEmbedding` in encoder-decoders that are not ours: the documented example, and a GRU."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from stylesim.forecasting.conditioner import fit_conditioner
from stylesim.forecasting.config import FUSIONS, READINGS
from stylesim.forecasting.samples import windows
from stylesim.forecasting.style_embedding import StyleContextEmbedding, style_parameter_groups
from stylesim.forecasting.style_table import style_table

from .made import SPEC, SpeedJudges, made_corpus

PAGE = Path(__file__).resolve().parents[3] / "docs" / "forecasting.md"
STEPS = 5


def documented() -> Any:
    found = re.search(r"<!-- example: a foreign model -->\n```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert found is not None
    names: dict[str, Any] = {}
    exec(found.group(1), names)
    assert isinstance(names["optimizer"], torch.optim.Optimizer)
    return names["Yours"]


class Recurrent(nn.Module):
    """A sequence-to-sequence GRU; the style is added to the state between the two."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder, self.decoder = nn.GRU(2, 16, batch_first=True), nn.GRU(1, 16, batch_first=True)
        self.out = nn.Linear(16, 2)
        self.style = StyleContextEmbedding(styles=6, width=16)

    def forward(self, past: Tensor, style_cond: Tensor) -> Tensor:
        _, state = self.encoder(past)
        path, _ = self.decoder(past.new_ones(len(past), STEPS, 1), state + self.style(style_cond)[None])
        out: Tensor = self.out(path)
        return out


def learned(model: nn.Module) -> tuple[float, float]:
    """Error with and without the style after learning a world where style alone decides: half brake, half do not."""
    past = torch.linspace(-1.0, 0.0, 4)[None, :, None].expand(32, 4, 2).contiguous()
    style = torch.zeros(32, 3, dtype=torch.int64)
    style[16:, 0] = 5
    pace = torch.where(style[:, 0] == 0, 1.0, -1.0)
    future = pace[:, None, None] * torch.linspace(0.2, 1.0, STEPS)[None, :, None].expand(32, STEPS, 2)
    optimizer = torch.optim.AdamW(style_parameter_groups(model, lr=3e-3, weight_decay=0.0))
    model.train()
    for _ in range(60):
        loss = (model(past, style) - future).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    model.eval()
    with torch.no_grad():
        knowing, ignorant = (model(past, given) for given in (style, torch.full_like(style, -1)))
    return float((knowing - future).abs().mean()), float((ignorant - future).abs().mean())


@pytest.mark.parametrize(
    ("fusion", "reading"), [*((fusion, "R1") for fusion in FUSIONS), *(("early", reading) for reading in READINGS[1:])]
)
def test_the_documented_transformer_learns_what_only_the_style_tells(fusion: str, reading: str) -> None:
    torch.manual_seed(0)
    knowing, ignorant = learned(documented()(width=16, steps=STEPS, fusion=fusion, reading=reading))
    assert knowing < 0.15
    assert ignorant > 0.5


def test_so_does_a_recurrent_one() -> None:
    torch.manual_seed(0)
    knowing, ignorant = learned(Recurrent())
    assert knowing < 0.2
    assert ignorant > 0.45


def test_the_table_has_the_cells_of_every_sample(tmp_path: Path) -> None:
    corpus = made_corpus(tmp_path / "c", scenes=12)
    conditioner, table = style_table(corpus, spec=SPEC, judges=SpeedJudges())
    _, cells = fit_conditioner("tdbm", SpeedJudges(), windows(corpus, SPEC), seed=0)
    np.testing.assert_array_equal(table.select("z", "k", "c").to_numpy(), cells)
    assert set(table["split"]) == {"train", "val"}
    assert (table["z"] >= 0).any()
    scene = next(iter(corpus))
    row = table.filter(scene_id=scene.scene_id, t0_frame=34)
    agents = np.array([scene.tracks.agent_id.index(name) for name in row["agent_id"]], np.int32)
    found = conditioner.style_cond(scene.history(34, 20), agents)
    np.testing.assert_array_equal(found, row.select("z", "k", "c").to_numpy())
