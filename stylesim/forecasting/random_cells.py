"""`RandomCells`: the control arm whose drivers get a cell by lot, with the frequencies of the real ones. No torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.forecasting.conditioning import StyleCells
from stylesim.randomness import stream


@dataclass(frozen=True, eq=False)
class RandomCells:
    """Cells (the null token among them) with their frequency in training; each driver keeps the one that he drew."""

    real: StyleCells
    cell: Int64[np.ndarray, "cell 3"]
    chance: Float64[np.ndarray, " cell"]
    seed: int

    @classmethod
    def fit(cls, real: StyleCells, training: Int64[np.ndarray, "row 3"], *, seed: int) -> RandomCells:
        """The frequencies of the real cells of the training samples."""
        cell, count = np.unique(training, axis=0, return_counts=True)
        return cls(real, cell, count / count.sum(), seed)

    def draw(self, drivers: Sequence[str]) -> Int64[np.ndarray, "row 3"]:
        """The cell of each driver; the same name draws the same."""
        edges = np.cumsum(self.chance)
        lot = np.array([stream(self.seed, 0, name, "random style").uniform() for name in drivers])
        return self.cell[np.minimum(np.searchsorted(edges, lot, side="right"), len(edges) - 1)]

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {
            "real": self.real.to_dict(),
            "cell": self.cell.tolist(),
            "chance": self.chance.tolist(),
            "seed": self.seed,
        }

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> RandomCells:
        """The inverse of `to_dict`."""
        cell = np.asarray(raw["cell"], np.int64).reshape(-1, 3)
        chance = np.asarray(raw["chance"], np.float64)
        return cls(StyleCells.from_dict(raw["real"]), cell, chance, int(raw["seed"]))
