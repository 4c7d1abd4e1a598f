"""How the behaviours of a class follow the knob: along the direction in which its measured drivers differ in `a`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from stylesim.calibration.measuring import Trial
from stylesim.calibration.proposal import LEAST_DRIVERS, Law, Proposal
from stylesim.style import STYLE_CLASSES

HALF_WIDTH = float(np.sqrt(3.0))  # of a uniform law in its sds: the knob is drawn uniformly over the class's stretch


@dataclass(frozen=True, eq=False)
class KnobLaw(Law):
    """A law whose mean moves by `half` from the middle of the class's stretch of the knob to its bold end."""

    half: Float64[np.ndarray, "style behaviour"]


def knob_laws(proposal: Proposal, trials: Sequence[Trial]) -> dict[str, KnobLaw]:
    """The same laws seen as knob and rest: a behaviour that explains `a` within the class follows the knob.

    The direction is that of the correlations of the behaviours with `a`; the sd of each behaviour stays what it was.
    """
    result = {}
    for road, law in proposal.items():
        half, rest = np.zeros_like(law.mean), law.sd.copy()
        for style in range(len(STYLE_CLASSES)):
            behaviour, a = _pooled(trials, road, style)
            if len(a) < LEAST_DRIVERS:
                continue
            r = (behaviour * a[:, None]).mean(axis=0) / np.maximum(behaviour.std(axis=0) * a.std(), 1e-9)
            direction = r / max(float(np.linalg.norm(r)), 1e-9)
            half[style] = HALF_WIDTH * law.sd[style] * direction
            rest[style] = law.sd[style] * np.sqrt(np.maximum(1.0 - direction**2, 0.0))
        result[road] = KnobLaw(law.mean, rest, half)
    return result


def _pooled(
    trials: Sequence[Trial], road: str, style: int
) -> tuple[Float64[np.ndarray, "driver behaviour"], Float64[np.ndarray, " driver"]]:
    """The drivers who measured as the class, centred within round and scenario."""
    parts_b, parts_a = [], []
    for trial in trials:
        scenario = np.array(trial.scenario, dtype=object)
        own = (trial.commanded == style) & (trial.measured == style) & (np.array(trial.road, dtype=object) == road)
        for one in sorted(set(scenario[own].tolist())):
            here = own & (scenario == one)
            parts_b.append(trial.behaviour[here] - trial.behaviour[here].mean(axis=0))
            parts_a.append(trial.a[here] - trial.a[here].mean())
    if not parts_a:
        return np.zeros((0, 0)), np.zeros(0)
    return np.concatenate(parts_b), np.concatenate(parts_a)
