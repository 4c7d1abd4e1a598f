"""`FeatureScaler`: the reference population's 5th and 95th percentile of each feature become 0 and 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.errors import InputError
from stylesim.labelers.context import CONTEXTS
from stylesim.labelers.drivers import DriverSample
from stylesim.labelers.features import FEATURES
from stylesim.labels import LabelFlag, StyleLabels

# REFERENCE section 1, scaling [ours].
LOW_PERCENTILE, HIGH_PERCENTILE = 5.0, 95.0
# A context with fewer drivers is scaled by all drivers together: the refusal limit of REFERENCE section 8.
LEAST_DRIVERS = 30
# Features that are scaled in log(1 + x) [recalled: some features are log-transformed].
LOGARITHMIC = ("j_l",)


@dataclass(frozen=True, eq=False)
class FeatureScaler:
    """Ranges of the features for windows of one length, per context (`context.CONTEXTS`).

    `low` and `high` are in the scaled quantity (log(1 + j_l)); `drivers` counts who the range was made of, 0 where
    the context borrows the range of all drivers together.
    """

    names: tuple[str, ...]
    length_s: float
    low: Float64[np.ndarray, "context feature"]
    high: Float64[np.ndarray, "context feature"]
    drivers: tuple[int, ...]
    total_drivers: int

    def scaled(
        self, value: Float64[np.ndarray, "row feature"], highway: Bool[np.ndarray, " row"]
    ) -> tuple[Float64[np.ndarray, "row feature"], Bool[np.ndarray, "row feature"]]:
        """The features on [0, 1], and where one had to be clamped; a missing one stays NaN."""
        context = highway.astype(np.int64)  # CONTEXTS: non-highway is 0
        low, high = self.low[context], self.high[context]
        relative = (transformed(value, self.names) - low) / np.maximum(high - low, 1e-9)
        return np.clip(relative, 0.0, 1.0), (relative < 0.0) | (relative > 1.0)

    def to_dict(self) -> dict[str, Any]:
        """As JSON-able values; floats survive JSON exactly."""
        return {
            "names": list(self.names),
            "length_s": self.length_s,
            "total_drivers": self.total_drivers,
            "contexts": {
                name: {"low": self.low[i].tolist(), "high": self.high[i].tolist(), "drivers": self.drivers[i]}
                for i, name in enumerate(CONTEXTS)
            },
        }

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> FeatureScaler:
        """From what `to_dict` gave; InputError if something is missing."""
        try:
            contexts = [raw["contexts"][name] for name in CONTEXTS]
            return cls(
                names=tuple(raw["names"]),
                length_s=float(raw["length_s"]),
                low=np.array([c["low"] for c in contexts], np.float64),
                high=np.array([c["high"] for c in contexts], np.float64),
                drivers=tuple(int(c["drivers"]) for c in contexts),
                total_drivers=int(raw["total_drivers"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"this is not a feature scaler: {type(error).__name__} {error}") from None


def transformed(value: Float64[np.ndarray, "row feature"], names: Sequence[str]) -> Float64[np.ndarray, "row feature"]:
    """The quantities that are scaled: log(1 + x) for LOGARITHMIC, the feature itself for the others."""
    logarithmic = np.isin(np.array(names), LOGARITHMIC)
    return np.where(logarithmic, np.log1p(np.where(logarithmic, value, 0.0)), value)


def clamped_shares(scaler: FeatureScaler, labels: StyleLabels) -> dict[str, tuple[float, float]]:
    """For each feature the shares of its known values that the scaler clamps to 0 and to 1; NaN without any.

    A driver without a leader has the cap of the scale as his gap, which is no observation: he does not count there.
    """
    highway = (labels.flags & int(LabelFlag.HIGHWAY)) != 0
    leaderless = (labels.flags & int(LabelFlag.NO_LEADER)) != 0
    scaled, clamped = scaler.scaled(labels.feature.astype(np.float64), highway)
    result = {}
    for i, name in enumerate(scaler.names):
        known = np.isfinite(scaled[:, i]) & ~(leaderless & (name == "s_front"))
        count = max(1, int(known.sum()))
        ends = [float((clamped[:, i] & known & (scaled[:, i] == end)).sum()) / count for end in (0.0, 1.0)]
        result[name] = (ends[0], ends[1]) if known.any() else (float("nan"), float("nan"))
    return result


def fit_scaler(sample: DriverSample, names: Sequence[str], *, length_s: float) -> FeatureScaler:
    """A scaler from one mean per driver. InputError if a feature is known of no driver at all."""
    value = transformed(sample.value[:, [FEATURES.index(name) for name in names]], names)
    known = np.isfinite(value)
    for i, name in enumerate(names):
        if not known[:, i].any():
            raise InputError(
                f"cannot fit a scaler for windows of {length_s:g} s: {name} is known of none of the {len(value)} "
                "drivers with a full window. Fit on scenes that are long enough and have "
                f"{_NEEDS.get(name, 'motor vehicles')}, choose shorter windows (FeatureOptions.window_s, history_s), "
                "or take a shipped scaler (stylesim.labelers.reference.default_labeler)."
            )
    low, high, drivers = [], [], []
    for highway in (False, True):  # in the order of CONTEXTS
        own = sample.highway == highway
        enough = bool((known[own].sum(axis=0) >= LEAST_DRIVERS).all())
        used = value[own] if enough else value
        low.append(np.nanpercentile(used, LOW_PERCENTILE, axis=0))
        high.append(np.nanpercentile(used, HIGH_PERCENTILE, axis=0))
        drivers.append(int(own.sum()) if enough else 0)
    return FeatureScaler(
        names=tuple(names),
        length_s=float(length_s),
        low=np.stack(low),
        high=np.stack(high),
        drivers=tuple(drivers),
        total_drivers=len(sample),
    )


_NEEDS = {"s_center": "a road with lanes", "s_front": "vehicles that follow others", "v_nei": "traffic"}
