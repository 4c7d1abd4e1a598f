"""What `fidelity` found, and its JSON form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.evaluation.commanded import EXCLUSIONS
from stylesim.evaluation.fidelity_agreement import Agreement
from stylesim.evaluation.fidelity_ranges import FeatureRanges
from stylesim.evaluation.fidelity_robustness import Variant
from stylesim.labelers.reference import DEFAULT_REFERENCE

FORMAT = "stylesim-fidelity"
SCHEMA_VERSION = 1
EVERYONE = "all drivers"


@dataclass(frozen=True, eq=False)
class Fidelity:
    """What `fidelity` found; see `Agreement`, `FeatureRanges` and `Variant` for the figures.

    `excluded` [style][reason] and `departed` [style] count drivers; `share_excluded` is the share of those that were
    to be judged. `about` names the corpus, its seed, the scalers with their hashes and provenance.
    """

    agreements: tuple[Agreement, ...]
    ranges: tuple[FeatureRanges, ...]
    variants: tuple[Variant, ...]
    departed: Mapping[str, int]
    excluded: Mapping[str, Mapping[str, int]]
    outcomes: Mapping[str, Mapping[str, int]]
    unseen: int
    knob: Float64[np.ndarray, " driver"]  # of the judged, in order, as are the next two
    measured_a: Float64[np.ndarray, " driver"]  # by sim-reference, whole trips; NaN where undetermined
    commanded: tuple[str, ...]
    about: Mapping[str, Any]

    def of(self, *, method: str = "tdbm", reference: str = DEFAULT_REFERENCE, span: str = "track") -> list[Agreement]:
        """The figures of every group by that labeller and span, in order; an empty list where there are none."""
        return [a for a in self.agreements if (a.method, a.reference, a.span) == (method, reference, span)]

    def share_excluded(self, style: str) -> float:
        """Of the drivers of that style that were to be judged, the share that could not; NaN without any."""
        found = self.excluded.get(style, {})
        lost = sum(found.get(reason, 0) for reason in EXCLUSIONS)
        asked = self.departed.get(style, 0) - sum(n for reason, n in found.items() if reason not in EXCLUSIONS)
        return lost / asked if asked else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, without single drivers."""
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "about": dict(self.about),
            "departed": dict(self.departed),
            "excluded": {style: dict(reasons) for style, reasons in self.excluded.items()},
            "judged_although": {style: dict(flags) for style, flags in self.outcomes.items()},
            "never_logged": self.unseen,
            "agreements": [one.to_dict() for one in self.agreements],
            "feature_ranges": [one.to_dict() for one in self.ranges],
            "robustness": [one.to_dict() for one in self.variants],
        }
