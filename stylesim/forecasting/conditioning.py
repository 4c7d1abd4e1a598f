"""`StyleCells`: the (style, cluster, context) that a prediction is conditioned on, from observed history only.

The style z is the class of TDBM or KDSC; the cluster k is the nearest of K centroids within that class on the four
KDSC features; the context c says highway or not. Everything fitted (scalers, centroids, which cells are filled) is
fitted on the training split and travels with the checkpoint. No torch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.errors import InputError, unknown
from stylesim.forecasting.intentions import kmeans, nearest_centre
from stylesim.forecasting.measured import CLUSTER_FEATURES, Measured
from stylesim.labels import UNDETERMINED

LEAST_IN_CELL = 20  # REFERENCE section 4: a cell with fewer training samples is given the null token [ours]
NULL = -1


@dataclass(frozen=True, eq=False)
class StyleCells:
    """The clusters within each style, and which cells (z, k, c) have enough training samples."""

    classes: tuple[str, ...]
    centre: Float64[np.ndarray, "style cluster 4"]  # of standardised log(1 + feature)
    mean: Float64[np.ndarray, " 4"]
    sd: Float64[np.ndarray, " 4"]
    filled: Bool[np.ndarray, "style cluster context"]

    @classmethod
    def fit(
        cls, measured: Measured, classes: Sequence[str], *, clusters: int, contexts: int, rng: np.random.Generator
    ) -> StyleCells:
        """Clusters of the training split's samples, K-means per style; InputError where no sample can be judged.

        Features are taken as log(1 + f) first: variances have long tails, and K-means would spend its clusters on
        a few outliers [ours].
        """
        known = (measured.style != UNDETERMINED) & np.isfinite(measured.feature).all(axis=1)
        if not known.any():
            raise InputError(
                "no training sample has a style: every class is undetermined or a KDSC feature is missing; "
                "look at the flags of `stylesim labels`, or train with condition 'none'"
            )
        raw = np.log1p(np.maximum(measured.feature[known], 0.0))
        mean, sd = raw.mean(axis=0), np.maximum(raw.std(axis=0), 1e-9)
        points, style = (raw - mean) / sd, measured.style[known]
        centre = np.zeros((len(classes), clusters, len(CLUSTER_FEATURES)))
        for z in range(len(classes)):
            if (style == z).any():
                centre[z], _ = kmeans(points[style == z], clusters, rng)
        everywhere = cls(tuple(classes), centre, mean, sd, np.ones((len(classes), clusters, contexts), bool))
        count = np.zeros(everywhere.filled.shape, np.int64)
        np.add.at(count, tuple(everywhere.assign(measured.rows(known)).T), 1)
        return cls(tuple(classes), centre, mean, sd, count >= LEAST_IN_CELL)

    def assign(self, measured: Measured, *, style: int | None = None) -> Int64[np.ndarray, "row 3"]:
        """(z, k, c) of each row, (-1, -1, -1) for the null token.

        `style` asks "what if": everyone has that style, with the cluster that his features are nearest to in it.
        """
        wanted = measured.style if style is None else np.full_like(measured.style, style)
        known = (wanted != UNDETERMINED) & np.isfinite(measured.feature).all(axis=1)
        points = (np.log1p(np.maximum(np.where(known[:, None], measured.feature, 0.0), 0.0)) - self.mean) / self.sd
        result = np.full((len(wanted), 3), NULL, np.int64)
        for z in range(len(self.classes)):
            rows = np.flatnonzero(known & (wanted == z))
            cluster, _ = nearest_centre(points[rows], self.centre[z])
            cell = np.stack([np.full(len(rows), z), cluster, measured.highway[rows]], axis=1)
            full = self.filled[tuple(cell.T)]
            result[rows[full]] = cell[full]
        return result

    def class_index(self, name: str) -> int:
        """The number of a class; InputError for an unknown one."""
        if name not in self.classes:
            raise unknown("style", name, self.classes)
        return self.classes.index(name)

    def network_settings(self) -> dict[str, int]:
        """What the network's configuration must say."""
        return dict(zip(("styles", "clusters", "contexts"), self.filled.shape, strict=True))

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        arrays = {name: getattr(self, name).tolist() for name in ("centre", "mean", "sd", "filled")}
        return {"classes": list(self.classes), **arrays}

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> StyleCells:
        """The inverse of `to_dict`."""
        numbers = {name: np.asarray(raw[name], np.float64) for name in ("centre", "mean", "sd")}
        return cls(classes=tuple(raw["classes"]), filled=np.asarray(raw["filled"], bool), **numbers)
