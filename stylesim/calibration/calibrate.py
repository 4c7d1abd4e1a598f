"""`calibrate`: from trial traffic to a calibration file, with a held-out check and its figures inside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stylesim.calibration.checking import Check, check
from stylesim.calibration.knob import knob_laws
from stylesim.calibration.measuring import Trial, run_trial
from stylesim.calibration.proposal import FIRST_SD, LAST_SD, Proposal, first_proposal, proposal_of, ranges_of, updated
from stylesim.calibration.regimes import Regimes, chosen_regimes
from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.labelers.reference import DEFAULT_REFERENCE, default_labeler, load_labeler
from stylesim.labelers.tdbm import TDBM
from stylesim.population import Population
from stylesim.simulation.request import SIMULATORS
from stylesim.styles import Calibration, load_calibration
from stylesim.version import __version__

CROWD = "tdbm_spectrum"  # all six classes in equal shares, because each must be met by all others
SEED_STEP = 1_000  # seeds of the rounds follow the given one; the checks begin that much later
LAST_ROUNDS = 3  # whose drivers say how a behaviour follows the knob


@dataclass(frozen=True, eq=False)
class Calibrated:
    """The file that was written, the figures round by round, and those of the checks."""

    path: Path
    rounds: tuple[dict[str, Any], ...]
    checks: tuple[Check, ...]


def calibrate(
    backend: str,
    *,
    out: str | Path,
    scenarios: Sequence[str] = (),
    held_out: str = "",
    scaler: str | Path = DEFAULT_REFERENCE,
    start: str | Path | None = None,
    rounds: int = 14,
    episodes: int = 3,
    check_episodes: int = 6,
    seed: int = 990_100,
    workers: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
) -> Calibrated:
    """Searches behaviours of the six classes with which drivers measure as commanded, and writes them to `out`.

    Every round simulates `episodes` of each scenario (names or folders; by default those that are held to the fidelity
    targets, without `held_out`) with drivers of all classes mixed, labels their whole trips with the frozen TDBM
    `scaler` (a shipped reference or a file), and moves each class's behaviours towards what measured as that class.
    Then three checks with other seeds: the scenarios calibrated on, the held-out scenario, and a held-out density (a
    quarter above the highest calibrated one). `start` goes on from an earlier calibration.
    InputError before any work for what cannot be calibrated; nothing is written if a round fails.
    """
    target = Path(out)
    if target.exists():
        raise InputError(f"{target} is there already; choose another --out, or remove it first")
    for what, value, least in (("rounds", rounds, 1), ("episodes", episodes, 1), ("check_episodes", check_episodes, 3)):
        if value < least:
            raise InputError(f"{what} must be at least {least}, not {value}")
    labeler = _judge(scaler)
    regimes = chosen_regimes(backend, scenarios, held_out)
    try:
        proposal, log, last = _search(
            backend, regimes, labeler, _first(start, regimes), rounds=rounds, episodes=episodes, seed=seed,
            workers=workers, progress=progress,
        )  # fmt: skip
        roads = ranges_of(knob_laws(proposal, last))
        checks = check(
            backend, regimes, labeler, roads, episodes=check_episodes, seed=seed + SEED_STEP, workers=workers,
            progress=progress,
        )  # fmt: skip
    finally:
        regimes.close()
    provenance = {
        "command": f"stylesim calibrate --backend {backend} --seed {seed} --rounds {rounds} --episodes {episodes}",
        "scenarios": list(regimes.names),
        "held_out_scenario": regimes.held_out_name,
        "densities": {name: list(span) for name, span in regimes.densities.items()},
        "held_out_densities": {name: list(span) for name, span in regimes.high_densities.items()},
        "seeds": {"rounds": [seed, seed + rounds - 1], "checks": [c.seed for c in checks]},
        "scaler_sha256": labeler.hash_,
        "versions": {"stylesim": __version__, SIMULATORS[backend]: version(SIMULATORS[backend])},
        "rounds": log,
        "checks": {one.name: one.to_dict() for one in checks},
    }
    about = f"Behaviours with which drivers in {backend} measure as commanded, found by `stylesim calibrate`."
    document = Calibration.model_validate(
        {"about": about, "backend": backend, "roads": roads, "provenance": provenance}
    )
    text = yaml.safe_dump(document.model_dump(mode="json"), sort_keys=False, allow_unicode=True, width=120)
    write_whole(target, text.encode())
    return Calibrated(target, tuple(log), checks)


def _judge(scaler: str | Path) -> TDBM:
    path = Path(scaler)
    found = load_labeler(path) if path.suffix == ".json" else default_labeler("tdbm", reference=str(scaler))
    if not isinstance(found, TDBM):
        raise InputError(f"{scaler} holds another labeller than TDBM, which styles are calibrated by")
    return found


def _first(start: str | Path | None, regimes: Regimes) -> Proposal:
    proposal = first_proposal(regimes.roads)
    if start is None:
        return proposal
    earlier = proposal_of(load_calibration(Path(start)))
    return proposal | {road: law for road, law in earlier.items() if road in proposal}


def _search(
    backend: str,
    regimes: Regimes,
    labeler: TDBM,
    proposal: Proposal,
    *,
    rounds: int,
    episodes: int,
    seed: int,
    workers: int,
    progress: Callable[[str, int, int], None] | None,
) -> tuple[Proposal, list[dict[str, Any]], list[Trial]]:
    """The laws after all rounds, the figures of each, and the last rounds' drivers."""
    log: list[dict[str, Any]] = []
    trials: list[Trial] = []
    keep = (LAST_SD / FIRST_SD) ** (1.0 / max(1, rounds - 1))
    for number in range(rounds):
        if progress is not None:
            progress("calibrating", number, rounds)
        with regimes.written(backend, ranges_of(proposal)) as path:
            crowd = Population.load(CROWD).calibrated(path)
            trial = run_trial(regimes.folders, crowd, labeler, seed=seed + number, episodes=episodes, workers=workers)
        recall = trial.recall()
        log.append(
            {
                "drivers": len(trial),
                "balanced_accuracy": round(float(np.nanmean(recall)), 4),
                "recall": [round(float(r), 3) for r in recall],
                "collisions": trial.collisions,
            }
        )
        trials = [*trials, trial][-LAST_ROUNDS:]
        if number < rounds - 1:
            proposal = updated(proposal, trial, sd=FIRST_SD * keep ** (number + 1))
    if progress is not None:
        progress("calibrating", rounds, rounds)
    return proposal, log, trials
