"""Counterfactual twins: two futures of one past. A forecast that has not seen the style must be the same for both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.corpus import Corpus
from stylesim.evaluation.intervals import Estimate, estimate
from stylesim.evaluation.metrics import MISS_THRESHOLD_M, forecast_errors, most_probable
from stylesim.evaluation.mixtures import best_weights, energy_score
from stylesim.evaluation.twin_pairs import FROM_START, NULL, TWIN, TwinPair, twin_answer, twin_pairs, twin_question
from stylesim.forecast import Forecast, Forecaster
from stylesim.windows import WindowSpec

RATES = ("covers_own", "covers_twin", "covers_both")
MIXTURE = ("score_m", "over_equal_m", "over_best_m")  # energy score; minus that of equal, and of the best weights


@dataclass(frozen=True, eq=False)
class TwinForecasts:
    """Drivers whose style was switched at t0. A future is covered where a mode ends within 2 m of it.

    `figures`: covers_own, covers_twin, covers_both (shares), apart_m (distance of both ends). `mixture` is of the two
    futures as an equal mixture: "twin" of the driver's own and its twin's, "null" of its own and its null twin's, which
    differ by chance alone. score_m is the energy score, over_equal_m what it exceeds that of the same modes with equal
    probabilities by (below 0: the probabilities inform), over_best_m that of the best probabilities for that mixture.
    """

    drivers: int
    identical: int  # forecasts of both pasts (which are the same, bit for bit) that are the same, bit for bit
    figures: Mapping[str, Estimate]
    mixture: Mapping[str, Mapping[str, Estimate]]
    counts: Mapping[str, int]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "drivers": self.drivers,
            "identical": self.identical,
            "figures": {name: value.to_dict() for name, value in self.figures.items()},
            "mixture": {
                pair: {name: value.to_dict() for name, value in figures.items()}
                for pair, figures in self.mixture.items()
            },
            "counts": dict(self.counts),
        }


def twin_forecasts(
    forecaster: Forecaster,
    corpora: Sequence[Corpus],
    *,
    spec: WindowSpec,
    modes: int,
    seed: int,
    beside: Sequence[Forecaster] = (),
) -> TwinForecasts | None:
    """Ask about every switched driver at its switch, of its own scene and of its twin's; None without twins.

    Both tasks carry the episode's ids. A forecast that differs all the same has not only looked at the history.
    """
    rows: dict[str, list[float]] = {name: [] for name in (*RATES, "apart_m")}
    scores: dict[str, list[tuple[float, ...]]] = {TWIN: [], NULL: []}
    units: dict[str, list[str]] = {TWIN: [], NULL: []}
    counts: Counter[str] = Counter()
    identical = 0
    for pair in twin_pairs(corpora, counts):
        if pair.t0 is None:
            counts[FROM_START] += 1
            continue
        answering = (forecaster, *beside)
        own, twin = (twin_question(s, pair.own, pair.driver, pair.t0, spec, answering) for s in (pair.own, pair.twin))
        if own is None or twin is None:
            counts["switched driver not seen long enough, or not forecast by all"] += 1
            continue
        answer, again = twin_answer(forecaster, own), twin_answer(forecaster, twin)
        identical += _same(answer, again)
        near = [_covers(one, truth, modes) for one, truth in ((answer, own.truth_m), (again, twin.truth_m))]
        for name, value in zip(RATES, (*near, all(near)), strict=True):
            rows[name].append(value)
        rows["apart_m"].append(float(np.linalg.norm(own.truth_m[0, -1] - twin.truth_m[0, -1])))
        null = _null_truth(pair, spec, answering)
        for name, other in ((TWIN, twin.truth_m), (NULL, null)):
            if other is not None:
                ends = np.stack([own.truth_m[0, -1], other[0, -1]]).astype(np.float64)
                scores[name].append(_mixture(answer, ends, modes))
                units[name].append(pair.unit)
    if not (units[TWIN] or counts):
        return None
    figures = {
        name: estimate(
            np.array(values, np.float64), units[TWIN], seed=seed, purpose=f"twins {name}", rate=name in RATES
        )
        for name, values in rows.items()
    }
    mixture = {
        pair: {
            name: estimate(column, units[pair], seed=seed, purpose=f"twins {pair} {name}")
            for name, column in zip(MIXTURE, _columns(scores[pair]), strict=True)
        }
        for pair in scores
    }
    return TwinForecasts(len(units[TWIN]), identical, figures, mixture, dict(counts))


def _columns(rows: list[tuple[float, ...]]) -> Float64[np.ndarray, "figure driver"]:
    return np.array(rows, np.float64).reshape(-1, len(MIXTURE)).T


def _same(one: Forecast, other: Forecast) -> bool:
    return (one.mode_m.tobytes(), one.probability.tobytes()) == (other.mode_m.tobytes(), other.probability.tobytes())


def _covers(answer: Forecast, truth_m: np.ndarray, modes: int) -> bool:
    errors = forecast_errors(answer.mode_m, answer.probability, truth_m, k=modes)
    return float(errors.min_fde_m[0]) <= MISS_THRESHOLD_M


def _null_truth(pair: TwinPair, spec: WindowSpec, answering: Sequence[Forecaster]) -> np.ndarray | None:
    if pair.null is None or pair.t0 is None:
        return None
    asked = twin_question(pair.null, pair.own, pair.driver, pair.t0, spec, answering)
    return None if asked is None else asked.truth_m


def _mixture(answer: Forecast, ends_m: Float64[np.ndarray, "2 2"], modes: int) -> tuple[float, float, float]:
    """Energy score of the k most probable modes (scaled to sum to 1), and what it exceeds both yardsticks by."""
    kept = most_probable(answer.probability, modes)[0]
    place = answer.mode_m[0, kept, -1].astype(np.float64)
    chance = answer.probability[0, kept].astype(np.float64)
    score = energy_score(place, chance / chance.sum(), ends_m)
    equal = energy_score(place, np.full(len(kept), 1.0 / len(kept)), ends_m)
    return score, score - equal, score - energy_score(place, best_weights(place, ends_m), ends_m)
