"""Twins from the start: another person, another past. Does the forecast move the way the future really moved?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float, Float64

from stylesim.corpus import Corpus
from stylesim.evaluation.intervals import Estimate, estimate
from stylesim.evaluation.ratios import ratio_estimate
from stylesim.evaluation.strata import DRIVER
from stylesim.evaluation.twin_pairs import NULL, TWIN, TwinPair, twin_answer, twin_pairs, twin_question
from stylesim.forecast import Forecaster
from stylesim.geometry import rotated
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, anchor_frames

LEAST_M = 1.0  # chosen: as for agents that stand; a true difference below it has no direction
FIGURES = ("true_m", "forecast_m", "agrees", "share", "beyond_share")


@dataclass(frozen=True, eq=False)
class TwinShift:
    """By pair ("twin": another style from the start; "null": the same style, other noise) what moved, and how far.

    Of the displacements over the future, each from its own place and heading at t0: true_m and forecast_m are the mean
    sizes of the difference between both worlds, true and forecast (mean of the modes); `agrees` is the share of windows
    in which both point the same way (a scalar product above 0); `share` is how much of the true difference the
    forecast makes (the slope through 0; 1 is all, 0 none), `beyond_share` the same of what constant velocity leaves.
    Windows whose true difference is below 1 m have no direction: they count in true_m and forecast_m alone.
    """

    figures: Mapping[str, Mapping[str, Estimate]]
    windows: Mapping[str, int]
    counts: Mapping[str, int]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        figures = {pair: {name: v.to_dict() for name, v in one.items()} for pair, one in self.figures.items()}
        return {"figures": figures, "windows": dict(self.windows), "counts": dict(self.counts)}


def twin_shift(
    forecaster: Forecaster,
    corpora: Sequence[Corpus],
    *,
    spec: WindowSpec,
    seed: int,
    beside: Sequence[Forecaster] = (),
) -> TwinShift | None:
    """Ask about the driver at every t0 of its episode and of its twin from the start; None without such twins."""
    rows: dict[str, list[dict[str, Any]]] = {TWIN: [], NULL: []}
    counts: Counter[str] = Counter()
    for pair in twin_pairs(corpora, counts):
        if pair.t0 is not None:
            continue
        counts["pairs"] += 1
        for name, other in ((TWIN, pair.twin), (NULL, pair.null)):
            if other is not None:
                rows[name] += _compared(forecaster, pair, other, spec, (forecaster, *beside))
    if not counts["pairs"]:
        return None
    figures = {name: _figures(found, f"shift {name}", seed) for name, found in rows.items()}
    return TwinShift(figures, {name: len(found) for name, found in rows.items()}, dict(counts))


def _compared(
    forecaster: Forecaster, pair: TwinPair, other: Scene, spec: WindowSpec, answering: Sequence[Forecaster]
) -> list[dict[str, Any]]:
    """One row per t0 at which the driver can be asked in both worlds."""
    found = []
    for t0 in anchor_frames(pair.own, spec):
        sides = []
        for scene in (pair.own, other):
            asked = twin_question(scene, scene, pair.driver, t0, spec, answering)  # other pasts: under their own ids
            if asked is None:
                break
            answer, agent = twin_answer(forecaster, asked), int(asked.task.agent_index[0])
            chance = answer.probability[0].astype(np.float64)
            mean = np.tensordot(chance / chance.sum(), answer.mode_m[0, :, -1].astype(np.float64), axes=1)
            sides.append(_displaced(scene, agent, t0, spec, asked.truth_m[0, -1], mean))
        if len(sides) == 2:
            true, forecast, kept = sides[1] - sides[0]
            found.append({"unit_id": pair.unit, "agent_id": pair.driver, **_row(true, forecast, kept)})
    return found


def _displaced(
    scene: Scene,
    agent: int,
    t0: int,
    spec: WindowSpec,
    truth_m: Float[np.ndarray, " 2"],
    forecast_m: Float[np.ndarray, " 2"],
) -> Float64[np.ndarray, "3 2"]:
    """True, forecast and constant-velocity displacement, x along the driver's heading at t0."""
    tracks = scene.tracks
    here = tracks.position_m[agent, t0].astype(np.float64)
    going = tracks.velocity_mps[agent, t0].astype(np.float64) * spec.steps(tracks.dt_s)[1] * tracks.dt_s
    moved = np.stack([truth_m.astype(np.float64) - here, forecast_m.astype(np.float64) - here, going])
    return np.asarray(rotated(moved, -float(tracks.heading_rad[agent, t0])), np.float64)


def _row(
    true: Float64[np.ndarray, " 2"], forecast: Float64[np.ndarray, " 2"], kept: Float64[np.ndarray, " 2"]
) -> dict[str, float]:
    told = bool(np.linalg.norm(true) >= LEAST_M)
    beyond = bool(np.linalg.norm(true - kept) >= LEAST_M)
    return {
        "true_m": float(np.linalg.norm(true)),
        "forecast_m": float(np.linalg.norm(forecast)),
        "told": float(told),
        "agrees": float(told and true @ forecast > 0),
        "along": float(true @ forecast) if told else 0.0,
        "size": float(true @ true) if told else 0.0,
        "beyond": float(beyond),
        "beyond_along": float((true - kept) @ (forecast - kept)) if beyond else 0.0,
        "beyond_size": float((true - kept) @ (true - kept)) if beyond else 0.0,
    }


def _figures(rows: list[dict[str, Any]], purpose: str, seed: int) -> dict[str, Estimate]:
    """A driver counts once, with the sums of its windows."""
    names = ("true_m", "forecast_m", "told", "agrees", "along", "size", "beyond", "beyond_along", "beyond_size")
    types: dict[str, Any] = {**dict.fromkeys(DRIVER, pl.String), **dict.fromkeys(names, pl.Float64)}
    table = pl.DataFrame(rows, schema=types)
    drivers = table.group_by(list(DRIVER), maintain_order=True).agg(pl.len().alias("n"), pl.col(names).sum())
    drivers = drivers.sort(DRIVER)
    told, beyond = drivers.filter(pl.col("told") > 0), drivers.filter(pl.col("beyond") > 0)

    def mean(frame: pl.DataFrame, name: str, count: str, *, rate: bool = False) -> Estimate:
        values = (frame[name] / frame[count]).to_numpy()
        return estimate(values, frame["unit_id"].to_list(), seed=seed, purpose=f"{purpose} {name}", rate=rate)

    def share(frame: pl.DataFrame, above: str, below: str, count: str) -> Estimate:
        over, under = ((frame[name] / frame[count]).to_numpy() for name in (above, below))
        return ratio_estimate(over, under, frame["unit_id"].to_list(), seed=seed, purpose=f"{purpose} {above}")

    return {
        "true_m": mean(drivers, "true_m", "n"),
        "forecast_m": mean(drivers, "forecast_m", "n"),
        "agrees": mean(told, "agrees", "told", rate=True),
        "share": share(told, "along", "size", "told"),
        "beyond_share": share(beyond, "beyond_along", "beyond_size", "beyond"),
    }
