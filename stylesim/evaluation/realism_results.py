"""What `realism` found: plain dataclasses of figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from stylesim.evaluation.exposure import Rate
from stylesim.evaluation.realism_profile import Profile

FORMAT = "stylesim-realism"
SCHEMA_VERSION = 2  # 2: distances per style have intervals


@dataclass(frozen=True)
class Spread:
    """A figure with the 95 % range of its resamples; NaN where it is not known."""

    value: float
    low: float
    high: float

    def to_dict(self) -> dict[str, float | None]:
        """Plain JSON values."""
        return {k: (float(v) if np.isfinite(v) else None) for k, v in vars(self).items()}


@dataclass(frozen=True)
class QuantityDistance:
    """One quantity, simulation against one recording.

    `distance` is Wasserstein-1 in the quantity's unit, `matched` the same after the simulation's cells of speed and
    density were weighted to the recording's; `covered` is the share of the recording in cells that both have. `floor`
    is the matched distance between random halves of the recording. `likelihood` of the recording under the matched
    simulation stands beside `best_likelihood`, which the recording's own distribution would reach.
    """

    quantity: str
    distance: Spread
    matched: Spread
    covered: float
    floor: Spread
    likelihood: float
    best_likelihood: float
    sim_seconds: float
    real_seconds: float

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {k: v.to_dict() if isinstance(v, Spread) else _plain(v) for k, v in vars(self).items()}


@dataclass(frozen=True)
class Ratio:
    """A matched figure of the simulation over the recording's, held to a target of 1 within `within`."""

    name: str
    sim: float
    real: float
    ratio: Spread
    within: float

    @property
    def met(self) -> bool | None:
        """True if the point estimate is within the target; None where it is not known."""
        return bool(abs(self.ratio.value - 1.0) <= self.within) if np.isfinite(self.ratio.value) else None

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "name": self.name,
            "sim": _plain(self.sim),
            "real": _plain(self.real),
            "ratio": self.ratio.to_dict(),
            "within": self.within,
            "met": self.met,
        }


@dataclass(frozen=True)
class StyleDistance:
    """Matched Wasserstein-1 distances of one measured style, blocks resampled; None under 30 drivers on either side."""

    style: str
    sim_drivers: int
    real_drivers: int
    matched: Mapping[str, Spread] | None

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        matched = None if self.matched is None else {k: v.to_dict() for k, v in self.matched.items()}
        return {"style": self.style, "sim": self.sim_drivers, "real": self.real_drivers, "matched": matched}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Simulation against one recording (or all of them pooled)."""

    real: str
    blocks: int
    within_unit: bool  # blocks are stretches of time of one unit: the floor speaks of that site alone
    quantities: tuple[QuantityDistance, ...]
    ratios: tuple[Ratio, ...]
    styles: tuple[StyleDistance, ...]
    collisions: Rate  # of the recording, per 1,000 km

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "real": self.real,
            "blocks": self.blocks,
            "within_unit": self.within_unit,
            "quantities": [one.to_dict() for one in self.quantities],
            "ratios": [one.to_dict() for one in self.ratios],
            "styles": [one.to_dict() for one in self.styles],
            "collisions_per_1000_km": self.collisions.to_dict(),
        }


@dataclass(frozen=True, eq=False)
class Realism:
    """Comparisons with every recording, and matched distances between recordings (site to site)."""

    sim: str
    collisions: Rate
    comparisons: tuple[Comparison, ...]
    between_recordings: Mapping[tuple[str, str], Mapping[str, float]]
    profiles: tuple[Profile, ...]  # the simulation first
    about: Mapping[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, without the histograms."""
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "sim": self.sim,
            "collisions_per_1000_km": self.collisions.to_dict(),
            "comparisons": [one.to_dict() for one in self.comparisons],
            "between_recordings": [
                {"pair": list(pair), "matched": {k: _plain(v) for k, v in found.items()}}
                for pair, found in self.between_recordings.items()
            ],
            "about": dict(self.about),
        }


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value
