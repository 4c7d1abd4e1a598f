"""What a calibration is worth, on traffic that it has not seen: fidelity, KDSC, surrogate safety."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.calibration.regimes import Regimes
from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.commanded import commanded_drivers
from stylesim.evaluation.criticality import criticality
from stylesim.evaluation.fidelity_agreement import Agreement, agreement_of, measured_tracks, measured_windows
from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.reference import default_labeler
from stylesim.labelers.tdbm import TDBM
from stylesim.population import Population
from stylesim.simulation.generate import generate
from stylesim.style import STYLE_CLASSES

CROWD = "tdbm_spectrum"
RECORDED = "real-reference"


@dataclass(frozen=True, eq=False)
class Check:
    """One group of unseen episodes. `agreements`: whole trips together and per scenario, then 11 s windows together.

    `kdsc_aggressive` is the share of each commanded class that KDSC, fitted on recordings, calls aggressive (empty
    where no such labeller is shipped); `safety` are the rows of `criticality`.
    """

    name: str
    seed: int
    agreements: tuple[Agreement, ...]
    kdsc_aggressive: dict[str, float]
    safety: tuple[dict[str, Any], ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values: the figures of fidelity with their intervals, and the confusion of all together."""
        return {
            "seed": self.seed,
            "fidelity": {
                f"{one.group}, {one.span}": {
                    "drivers": one.n_drivers,
                    "classes_present": one.classes_present,
                    **{
                        name: [round(float(e.value), 3), round(float(e.low), 3), round(float(e.high), 3)]
                        for name, e in one.estimates.items()
                        if name in ("balanced_accuracy", "kappa", "knob_to_a")
                    },
                }
                for one in self.agreements
            },
            "confusion": [[round(n) for n in row] for row in self.agreements[0].count.tolist()],
            "kdsc_aggressive": self.kdsc_aggressive,
            "safety": list(self.safety),
        }


def check(
    backend: str,
    regimes: Regimes,
    labeler: TDBM,
    roads: dict[str, Any],
    *,
    episodes: int,
    seed: int,
    workers: int,
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[Check, ...]:
    """The scenarios calibrated on, the held-out one, and the held-out density, each with a seed of its own."""
    groups = [
        ("calibrated scenarios, other seed", list(regimes.folders)),
        ("held-out scenario", [regimes.held_out_folder] if regimes.held_out_folder else []),
        ("held-out density", list(regimes.dense_folders)),
    ]
    result = []
    for number, (name, folders) in enumerate(groups):
        if progress is not None:
            progress("checking", number, len(groups))
        if not folders:
            continue
        with regimes.written(backend, roads) as path, tempfile.TemporaryDirectory(prefix="stylesim-check-") as folder:
            crowd = Population.load(CROWD).calibrated(path)
            corpus = generate(
                folders, crowd, episodes=episodes, seed=seed + number, out=Path(folder) / "check", workers=workers
            )
            result.append(_judged(name, corpus, labeler, seed=seed + number))
    if progress is not None:
        progress("checking", len(groups), len(groups))
    return tuple(result)


def _judged(name: str, corpus: Corpus, labeler: TDBM, *, seed: int) -> Check:
    people = commanded_drivers(corpus, labeler.options)
    who = people.judged
    commanded, knob = people.commanded[who], people.knob[who]
    unit = [u for u, kept in zip(people.unit, who, strict=True) if kept]
    scenario = np.array(people.scenario, dtype=object)[who]
    trips = measured_tracks(labeler.judge(people.tracks), reference="given")
    windows = measured_windows(labeler.judge(people.windows), people.owner, len(unit), reference="given")
    everyone = np.ones(len(unit), bool)
    agreements = [agreement_of("all", commanded, knob, unit, trips, everyone)]
    for one in sorted(set(scenario.tolist())):
        agreements.append(agreement_of(one, commanded, knob, unit, trips, scenario == one))
    agreements.append(agreement_of("all", commanded, knob, unit, windows, everyone))
    return Check(name, seed, tuple(agreements), _kdsc(people.tracks, commanded), _safety(corpus))


def _kdsc(rows: Any, commanded: Any) -> dict[str, float]:
    """Share of each commanded class that a KDSC of recordings calls aggressive."""
    try:
        labeler = default_labeler("kdsc", reference=RECORDED)
    except InputError:
        return {}
    assert isinstance(labeler, KDSC)
    labels = labeler.judge(rows)
    first = labels.style == labels.classes.index("aggressive")
    return {name: round(float(first[commanded == i].mean()), 3) for i, name in enumerate(STYLE_CLASSES)}


def _safety(corpus: Corpus) -> tuple[dict[str, Any], ...]:
    return tuple(row.to_dict() for row in criticality(corpus, draws=200).rows)
