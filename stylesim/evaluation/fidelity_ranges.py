"""Per feature: what each class needs, what the traffic left its drivers, and what the scale cut off."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.labelers.scaler import FeatureScaler
from stylesim.labelers.tdbm import TDBM
from stylesim.labelers.tdbm_matrix import scores
from stylesim.labels import LabelFlag, StyleLabels
from stylesim.style import STYLE_CLASSES

INNER = (5.0, 95.0)  # the scaler's own percentiles (REFERENCE section 1)
POINTS = 14  # 2**14 Sobol points: each class then holds 900 or more (6 % of the cube is the least)


@lru_cache(maxsize=2)
def needed_ranges(orientation: str = "printed") -> Float64[np.ndarray, "style feature end"]:
    """Per class the 5 to 95 % range of each scaled feature over the part of the cube where it has the highest score.

    The cube is [0, 1]^5, evenly filled. NaN for a class that wins nowhere (transposed orientation).
    """
    from scipy.stats.qmc import Sobol

    cube = Sobol(5, scramble=False).random_base2(POINTS)
    best = scores(cube, orientation).argmax(axis=1)
    result = np.full((len(STYLE_CLASSES), 5, 2), np.nan)
    for place in range(len(STYLE_CLASSES)):
        own = cube[best == place]
        if len(own):
            result[place] = np.percentile(own, INNER, axis=0).T
    result.flags.writeable = False
    return result


def scaled_features(labeler: TDBM, labels: StyleLabels) -> Float64[np.ndarray, "row feature"]:
    """The features on [0, 1] as the labeller judged them (1 for the gap of who had no leader); NaN where missing."""
    scaler = labeler.scaler("track", labeler.options.window_s)
    highway = (labels.flags & int(LabelFlag.HIGHWAY)) != 0
    scaled, _ = scaler.scaled(labels.feature.astype(np.float64), highway)
    leaderless = (labels.flags & int(LabelFlag.NO_LEADER)) != 0
    scaled[leaderless, scaler.names.index("s_front")] = 1.0
    return scaled


@dataclass(frozen=True, eq=False)
class FeatureRanges:
    """Of one group of drivers. Ends are the 5 and 95 % points of the scaled feature; NaN where a class has nobody."""

    group: str
    names: tuple[str, ...]
    left: Float64[np.ndarray, "style feature end"]
    everyone: Float64[np.ndarray, "feature end"]
    si: Float64[np.ndarray, "style feature end"]
    clamped: Float64[np.ndarray, "feature end"]  # share of drivers below and above the scale
    drivers: tuple[int, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        needs = needed_ranges()
        return {
            "group": self.group,
            "drivers": dict(zip(STYLE_CLASSES, self.drivers, strict=True)),
            "features": {
                name: {
                    "clamped_below": _plain(self.clamped[i, 0]),
                    "clamped_above": _plain(self.clamped[i, 1]),
                    "all": [_plain(end) for end in self.everyone[i]],
                    "classes": {
                        style: {
                            "needs": [_plain(end) for end in needs[place, i]],
                            "left": [_plain(end) for end in self.left[place, i]],
                            "left_si": [_plain(end) for end in self.si[place, i]],
                        }
                        for place, style in enumerate(STYLE_CLASSES)
                    },
                }
                for i, name in enumerate(self.names)
            },
        }


def _plain(value: float) -> float | None:
    return round(float(value), 6) if np.isfinite(value) else None


def ranges_of(
    group: str,
    labeler: TDBM,
    labels: StyleLabels,
    commanded: Int64[np.ndarray, " row"],
    chosen: Bool[np.ndarray, " row"],
) -> FeatureRanges:
    """The ranges of the chosen drivers by commanded class, and the clamped shares of all of them."""
    scaler = labeler.scaler("track", labeler.options.window_s)
    scaled = scaled_features(labeler, labels)
    count, features = len(STYLE_CLASSES), len(scaler.names)
    left, si = np.full((count, features, 2), np.nan), np.full((count, features, 2), np.nan)
    for place in range(count):
        own = chosen & (commanded == place)
        left[place], si[place] = _inner(scaled[own]), _inner(labels.feature[own].astype(np.float64))
    return FeatureRanges(
        group=group,
        names=scaler.names,
        left=left,
        everyone=_inner(scaled[chosen]),
        si=si,
        clamped=_clamped(scaler, labels.rows(np.flatnonzero(chosen))),
        drivers=tuple(int((chosen & (commanded == place)).sum()) for place in range(count)),
    )


def _inner(value: Float64[np.ndarray, "row feature"]) -> Float64[np.ndarray, "feature end"]:
    """5 and 95 % points of each column's known values."""
    result = np.full((value.shape[1], 2), np.nan)
    for i in range(value.shape[1]):
        known = value[np.isfinite(value[:, i]), i]
        if len(known):
            result[i] = np.percentile(known, INNER)
    return result


def _clamped(scaler: FeatureScaler, labels: StyleLabels) -> Float64[np.ndarray, "feature end"]:
    from stylesim.labelers.scaler import clamped_shares

    found = clamped_shares(scaler, labels)
    return np.array([found[name] for name in scaler.names])
