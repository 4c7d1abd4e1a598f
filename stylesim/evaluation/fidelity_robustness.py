"""The same drivers measured otherwise: another smoother, window, mu and k, radius, and with the wander left out.

Every variant is judged by the same frozen scaler, whose ranges were made with the default options: a figure that falls
says that the classes rest on that choice, or that the scale no longer fits it. That is what a user meets who measures
recordings with other options.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stylesim.corpus import Corpus
from stylesim.evaluation.commanded import CommandedDrivers, commanded_drivers
from stylesim.evaluation.fidelity_agreement import Agreement, agreement_of, measured_tracks
from stylesim.kinematics import Smoother
from stylesim.labelers.features import FEATURES
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.scaler import FeatureScaler
from stylesim.labelers.tdbm import TDBM
from stylesim.labels import LabelFlag

# Chosen: about a third less and half as much again of each length, half and twice of each weight.
VARIANTS: dict[str, Callable[[FeatureOptions], FeatureOptions]] = {
    "smoother 0.7 s": lambda o: replace(o, smoother=Smoother(length_s=0.7)),
    "smoother 1.7 s": lambda o: replace(o, smoother=Smoother(length_s=1.7)),
    "windows of 7 s": lambda o: replace(o, window_s=7.0),
    "windows of 16 s": lambda o: replace(o, window_s=16.0),
    "μ = 0.5 /s": lambda o: replace(o, mu_per_s=0.5),
    "μ = 2 /s": lambda o: replace(o, mu_per_s=2.0),
    "k = 1 s": lambda o: replace(o, lane_change_s=1.0),
    "k = 4 s": lambda o: replace(o, lane_change_s=4.0),
    "radius 50 m": lambda o: replace(o, radius_m=50.0),
    "radius 150 m": lambda o: replace(o, radius_m=150.0),
}
DEFAULT, NO_WANDER = "as shipped", "wander off"


@dataclass(frozen=True, eq=False)
class Variant:
    """One way of measuring and its figures over all judged drivers."""

    name: str
    agreement: Agreement

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"variant": self.name, **self.agreement.to_dict()}


def middle_of_lane(rows_scaler: FeatureScaler, people: CommandedDrivers) -> CommandedDrivers:
    """The same drivers with s_center in the middle of the scale, whatever they did.

    Chosen in place of driving the same episodes without wander: lane keeping feeds no other feature, so this leaves
    the other four exactly as they were driven, and needs no second simulation.
    """
    value = people.tracks.value.copy()
    highway = people.tracks.flagged(LabelFlag.HIGHWAY).astype(np.int64)
    at = rows_scaler.names.index("s_center")
    middle = (rows_scaler.low[highway, at] + rows_scaler.high[highway, at]) / 2
    column = FEATURES.index("s_center")
    value[:, column] = np.where(np.isfinite(value[:, column]), middle, np.nan)
    return replace(people, tracks=replace(people.tracks, value=value))


def robustness(
    corpus: Corpus,
    labeler: TDBM,
    people: CommandedDrivers,
    *,
    reference: str,
    scenarios: tuple[str, ...] = (),
    seed: int = 0,
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[Variant, ...]:
    """Figures of whole trips for every variant; `people` are the drivers as the labeller's own options see them.

    `progress` is called with the variant's name, the scenes done and their number.
    """

    def judged(name: str, drivers: CommandedDrivers) -> Variant:
        found = measured_tracks(labeler.judge(drivers.tracks), reference=reference)
        who = drivers.judged
        unit = [u for u, kept in zip(drivers.unit, who, strict=True) if kept]
        everyone = np.ones(len(unit), bool)
        figures = agreement_of(name, drivers.commanded[who], drivers.knob[who], unit, found, everyone, seed=seed)
        return Variant(name, figures)

    found = [judged(DEFAULT, people), judged(NO_WANDER, middle_of_lane(labeler.track_scaler_, people))]
    for name, change in VARIANTS.items():

        def report(done: int, total: int, name: str = name) -> None:
            if progress is not None:
                progress(name, done, total)

        found.append(
            judged(name, commanded_drivers(corpus, change(labeler.options), scenarios=scenarios, progress=report))
        )
    return tuple(found)
