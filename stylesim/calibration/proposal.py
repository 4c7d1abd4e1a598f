"""What the next round draws its drivers from, how a round changes it, and how it is written as a calibration.

An evolution strategy (natural gradient of a normal law whose sd shrinks, Wierstra et al. 2014 [recalled]) in log space,
one independent law for each behaviour of each class on each kind of road: drivers are drawn from it, and its mean moves
by the correlation of each behaviour with success, because a driver for a wanted class shall be drawn from what measured
as that class. Success is soft, so that who missed narrowly counts too. Moving towards the widest margins instead (the
cross-entropy method with an elite of 35 %) was tried and lost: it rewards what succeeds by luck in empty traffic.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.calibration.behaviours import BEHAVIOURS, HIGH, LARGEST_SPEED_FACTOR, LOW, WIDTH, start
from stylesim.calibration.measuring import Trial
from stylesim.errors import InputError
from stylesim.style import STYLE_CLASSES
from stylesim.styles import COMFORT, Calibration

FIRST_SD = 0.12  # of a log, times the width; chosen, because the start is near and 2 sd are a quarter
LAST_SD = 0.05  # chosen, because people of one style differ
STEP = 1.5  # sds that a behaviour moves when it explains success wholly; chosen: 2 overshoots, 1 takes twice the rounds
SOFT_MARGIN = 0.2  # score at which success counts 0.73; chosen, the width of a fragile margin (REFERENCE section 1)
RANK_WEIGHT = 1.0  # of the distance between a driver's rank in `a` and in the knob; chosen, because both shall agree
LEAST_DRIVERS = 20  # of a class and kind of road in a round; with fewer nothing is learned


@dataclass(frozen=True, eq=False)
class Law:
    """Mean and sd of the log of each behaviour of each class."""

    mean: Float64[np.ndarray, "style behaviour"]
    sd: Float64[np.ndarray, "style behaviour"]


Proposal = dict[str, Law]  # by kind of road


def first_proposal(roads: tuple[str, ...]) -> Proposal:
    """Where the search begins."""
    return {road: Law(start(road), np.tile(FIRST_SD * WIDTH, (len(STYLE_CLASSES), 1))) for road in roads}


def updated(proposal: Proposal, trial: Trial, *, sd: float) -> Proposal:
    """The laws after a round; `sd` (times the widths) is what the next one draws with."""
    road = np.array(trial.road, dtype=object)
    result = {}
    for name, law in proposal.items():
        mean = law.mean.copy()
        for style in range(len(STYLE_CLASSES)):
            own = np.flatnonzero((road == name) & (trial.commanded == style))
            if len(own) >= LEAST_DRIVERS:
                mean[style] += STEP * law.sd[style] * _correlation(trial, own)
        result[name] = Law(np.clip(mean, LOW, HIGH), np.tile(sd * WIDTH, (len(STYLE_CLASSES), 1)))
    return result


def _correlation(trial: Trial, own: Int64[np.ndarray, " driver"]) -> Float64[np.ndarray, " behaviour"]:
    """Of each behaviour with soft success, within scenarios (so that an easy scenario teaches nothing by itself)."""
    scenario = np.array(trial.scenario, dtype=object)[own]
    success = 1.0 / (1.0 + np.exp(-np.clip(trial.margin[own] / SOFT_MARGIN, -50.0, 50.0)))
    success -= RANK_WEIGHT * np.abs(_rank(trial.a) - _rank(trial.knob))[own]
    behaviour = trial.behaviour[own].copy()
    for one in set(scenario.tolist()):
        here = scenario == one
        success[here] -= success[here].mean()
        behaviour[here] -= behaviour[here].mean(axis=0)
    spread = success.std() * behaviour.std(axis=0)
    return (success[:, None] * behaviour).mean(axis=0) / np.maximum(spread, 1e-9)


def _rank(value: Float64[np.ndarray, " driver"]) -> Float64[np.ndarray, " driver"]:
    """Place of each driver among all, 0 to 1."""
    return np.argsort(np.argsort(value, kind="stable"), kind="stable") / max(1, len(value) - 1)


def ranges_of(laws: Mapping[str, Law]) -> dict[str, Any]:
    """The `roads` of a calibration file: constant over a class, unless a law follows the knob (has a `half`)."""
    roads: dict[str, Any] = {}
    for road, law in laws.items():
        half = getattr(law, "half", np.zeros_like(law.mean))
        calm = np.exp(np.clip(law.mean - half, LOW, HIGH))
        bold = np.exp(np.clip(law.mean + half, LOW, HIGH))
        table = {
            behaviour.name: {
                name: {
                    "calm": round(float(calm[i, j]), 4),
                    "bold": round(float(bold[i, j]), 4),
                    "spread": round(float(min(law.sd[i, j], 0.5)), 4),
                }
                for i, name in enumerate(STYLE_CLASSES)
            }
            for j, behaviour in enumerate(BEHAVIOURS)
        }
        table["desired_speed_factor"] = {
            name: {"calm": most, "bold": most, "spread": table[COMFORT][name]["spread"]}
            for name, most in LARGEST_SPEED_FACTOR.items()
        }
        roads[road] = table
    return roads


def proposal_of(calibration: Calibration) -> Proposal:
    """Laws to go on from: the middle of each range of a calibration. InputError if it lacks a behaviour."""
    result = {}
    for road, ranges in calibration.roads.items():
        lacking = [b.name for b in BEHAVIOURS if b.name not in ranges]
        if lacking:
            raise InputError(f"the calibration to start from has no {lacking[0]!r} for {road!r}; start without it")
        ends = [[(ranges[b.name][name].calm, ranges[b.name][name].bold) for b in BEHAVIOURS] for name in STYLE_CLASSES]
        middle = np.log(np.maximum(np.array(ends), 1e-3)).mean(axis=2)
        result[str(road)] = Law(np.clip(middle, LOW, HIGH), np.tile(FIRST_SD * WIDTH, (len(STYLE_CLASSES), 1)))
    return result
