"""`StyleVectors`: style as a vector of numbers in place of a cell: class scores, or raw features. No torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int64

from stylesim.errors import InputError, unknown
from stylesim.forecasting.measured import Measured
from stylesim.labels import UNDETERMINED

FORMS = ("scores", "features")


@dataclass(frozen=True, eq=False)
class StyleVectors:
    """Standardised columns; a row of NaN asks for the null token. The last column is the context (highway or not).

    Form "scores": a driver whose class is undetermined gets the null token, as with cells. Form "features": raw
    features as sign(f) log(1 + |f|), then for each of them whether it is missing (it is 0 then); the null token where
    all are. Columns that are constant in training are left out.
    """

    form: str
    classes: tuple[str, ...]
    mean: Float64[np.ndarray, " column"]
    sd: Float64[np.ndarray, " column"]
    used: Int64[np.ndarray, " used"]  # columns that vary in training, of those that `_columns` makes
    typical: Float64[np.ndarray, "style used"]  # mean vector of each class in training; NaN without drivers

    @classmethod
    def fit(cls, measured: Measured, classes: Sequence[str], *, form: str) -> StyleVectors:
        """Scales of the training split's samples. InputError where there is nothing to scale."""
        if form not in FORMS:
            raise unknown("form of a style vector", form, FORMS)
        columns = _columns(measured, form)
        known = np.isfinite(columns).all(axis=1)
        if columns.shape[1] == 1:
            raise InputError(f"these judges give no {form}; use the labellers, or a condition of cells")
        if not known.any():
            raise InputError(
                f"no training sample has {form}: every class is undetermined; look at the flags of `stylesim labels`, "
                "or train with condition 'none'"
            )
        mean, sd = columns[known].mean(axis=0), columns[known].std(axis=0)
        used = np.flatnonzero(sd > 1e-9)
        if not len(used):
            raise InputError(f"the {form} of all training samples are the same; there is nothing to condition on")
        scaled = ((columns - mean) / np.maximum(sd, 1e-9))[:, used]
        typical = np.full((len(classes), len(used)), np.nan)
        for z in range(len(classes)):
            rows = known & (measured.style == z)
            if rows.any():
                typical[z] = scaled[rows].mean(axis=0)
        return cls(form, tuple(classes), mean, np.maximum(sd, 1e-9), used, typical)

    def assign(self, measured: Measured, *, style: int | None = None) -> Float32[np.ndarray, "row used"]:
        """The vector of each row, NaN for the null token.

        `style` asks "what if": everyone has the mean vector of that class in training, in his own context.
        """
        columns = _columns(measured, self.form)
        scaled = ((columns - self.mean) / self.sd)[:, self.used]
        known = np.isfinite(scaled).all(axis=1)
        if style is not None:
            context = self.used == len(self.mean) - 1
            scaled = np.where(context, scaled, self.typical[style])
            known &= np.isfinite(self.typical[style]).all()
        return np.where(known[:, None], scaled, np.nan).astype(np.float32)

    def class_index(self, name: str) -> int:
        """The number of a class; InputError for an unknown one."""
        if name not in self.classes:
            raise unknown("style", name, self.classes)
        return self.classes.index(name)

    def network_settings(self) -> dict[str, int]:
        """What the network's configuration must say."""
        return {"style_features": len(self.used)}

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        arrays = {name: getattr(self, name).tolist() for name in ("mean", "sd", "used")}
        typical = [None if np.isnan(row).any() else row.tolist() for row in self.typical]
        return {"form": self.form, "classes": list(self.classes), **arrays, "typical": typical}

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> StyleVectors:
        """The inverse of `to_dict`."""
        used = np.asarray(raw["used"], np.int64)
        typical = [np.full(len(used), np.nan) if row is None else row for row in raw["typical"]]
        return cls(
            form=raw["form"],
            classes=tuple(raw["classes"]),
            mean=np.asarray(raw["mean"], np.float64),
            sd=np.asarray(raw["sd"], np.float64),
            used=used,
            typical=np.asarray(typical, np.float64).reshape(len(raw["classes"]), len(used)),
        )


def _columns(measured: Measured, form: str) -> Float64[np.ndarray, "row column"]:
    """The numbers before scaling; a row of NaN where nothing is known."""
    if form == "scores":
        columns = measured.score
        unknown_row = (measured.style == UNDETERMINED) | ~np.isfinite(columns).all(axis=1)
    else:
        missing = ~np.isfinite(measured.evidence)
        raw = np.where(missing, 0.0, measured.evidence)
        columns = np.concatenate([np.sign(raw) * np.log1p(np.abs(raw)), missing], axis=1)
        unknown_row = missing.all(axis=1)
    columns = np.concatenate([columns, measured.highway[:, None]], axis=1)
    return np.where(unknown_row[:, None], np.nan, columns)
