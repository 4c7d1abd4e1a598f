"""Did the forecast hold the decision that was taken - stop or go at the yellow, go first or yield?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Bool, Float

from stylesim.corpus import Corpus
from stylesim.evaluation.asking import checked_answers, reveal
from stylesim.evaluation.decisions import FIRST_OR_SECOND, STOP_OR_GO, Decision, goes
from stylesim.evaluation.decisions_yellow import yellow_decisions_of
from stylesim.evaluation.decisions_yield import yield_decisions_of
from stylesim.evaluation.intervals import Estimate, estimate
from stylesim.evaluation.metrics import most_probable
from stylesim.evaluation.slices import ALL, value_order
from stylesim.evaluation.strata import DRIVER
from stylesim.forecast import Forecaster, ForecastTask, covered, earlier_s
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, earlier_scene, target_agents

KINDS = (STOP_OR_GO, FIRST_OR_SECOND)
MEASURES = ("covered", "mass", "top_right", "brier")
CUTS = (ALL, "taken", "scenario", "commanded", "with an event")  # by what the decisions of a kind are told apart
SCHEMA: dict[str, Any] = {
    "unit_id": pl.String, "agent_id": pl.String, "scene_id": pl.String, "t0_frame": pl.Int32, "scenario": pl.String,
    "commanded": pl.String, "kind": pl.String, "taken": pl.String, "with an event": pl.String,
    **dict.fromkeys(MEASURES, pl.Float64),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class DecisionCell:
    """Decisions of one kind with one `value` of `by`. A driver counts once, with the mean of its decisions.

    `covered`: a mode holds the decision taken (1 minus the miss rate); `mass`: the probability of the modes that hold
    it; `top_right`: the most probable mode holds it; `brier`: (1 - mass)², which with two outcomes is proper.
    `guessing` is the Brier score of one probability for everybody, the share that took each side: what must be beaten.
    """

    kind: str
    by: str
    value: str
    decisions: int
    measures: Mapping[str, Estimate]
    guessing: float

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "kind": self.kind, "by": self.by, "value": self.value, "decisions": self.decisions,
            "guessing_brier": self.guessing if np.isfinite(self.guessing) else None,
            **{name: value.to_dict() for name, value in self.measures.items()},
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Decisions:
    """Cells per kind: all, by what was done, scenario, style, event. `table` has a row per decision."""

    cells: tuple[DecisionCell, ...]
    table: pl.DataFrame
    counts: Mapping[str, int]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, without the table."""
        return {"cells": [one.to_dict() for one in self.cells], "counts": dict(self.counts)}


def decisions(
    forecaster: Forecaster,
    populations: Mapping[str, Sequence[Corpus]],
    *,
    spec: WindowSpec,
    modes: int,
    seed: int,
    beside: Sequence[Forecaster] = (),
) -> Decisions:
    """Ask at every decision of the corpora; units get their population's name before them, as in `stress_windows`."""
    counts: Counter[str] = Counter()
    rows = [
        {**row, "unit_id": f"{population}:{row['unit_id']}"}
        for population, corpora in populations.items()
        for corpus in corpora
        for scene in corpus
        for row in _of_scene(forecaster, scene, spec, modes, counts, (forecaster, *beside))
    ]
    table = pl.DataFrame(rows, schema=SCHEMA)
    return Decisions(decision_cells(table, seed=seed), table, dict(counts))


def _of_scene(
    forecaster: Forecaster,
    scene: Scene,
    spec: WindowSpec,
    modes: int,
    counts: Counter[str],
    answering: Sequence[Forecaster],
) -> Iterator[dict[str, Any]]:
    history, future, _ = spec.steps(scene.tracks.dt_s)
    found = [*yellow_decisions_of(scene, future, counts), *yield_decisions_of(scene, future, counts)]
    actors = {event["actor"] for event in scene.metadata.get("events", ())}
    reveal(forecaster, scene)
    found.sort(key=lambda one: (one.t0, one.agent, one.kind, one.steps))
    for t0, group in groupby(found, key=lambda one: one.t0):
        able = set(target_agents(scene, t0, spec, need_future=False).tolist())
        asked = []
        for one in group:
            if scene.tracks.agent_id[one.agent] in actors:
                counts["decisions of who caused an event (what it did was not its style)"] += 1
            elif one.agent not in able:
                counts["decisions of who has not been seen for a second"] += 1
            else:
                asked.append(one)
        agents = np.array(sorted({one.agent for one in asked}), np.int32)
        past, earlier = scene.history(t0, history), earlier_scene(scene, t0, history, earlier_s(answering))
        known = covered(answering, ForecastTask(past, agents, future, t0, earlier))
        counts["decisions not forecast by all"] += sum(one.agent in agents[~known] for one in asked)
        agents = agents[known]
        if not len(agents):
            continue
        answer = checked_answers(forecaster, [ForecastTask(past, agents, future, t0, earlier)])[0]
        place = {int(agent): row for row, agent in enumerate(agents)}
        for one in asked:
            if one.agent in place:
                row = place[one.agent]
                kept = most_probable(answer.probability[row : row + 1], modes)[0]
                yield _row(scene, one, goes(one, answer.mode_m[row, kept]), answer.probability[row, kept])


def _row(
    scene: Scene, one: Decision, gone: Bool[np.ndarray, " mode"], probability: Float[np.ndarray, " mode"]
) -> dict[str, Any]:
    """`gone` says of each mode, most probable first, whether it goes."""
    holds = gone == one.went
    chance = probability.astype(np.float64) / probability.astype(np.float64).sum()
    mass = float(min(chance[holds].sum(), 1.0))
    driver = scene.tracks.driver[one.agent]
    return {
        "unit_id": scene.unit_id, "agent_id": scene.tracks.agent_id[one.agent], "scene_id": scene.scene_id,
        "t0_frame": one.t0, "scenario": scene.scenario, "commanded": "not commanded" if driver is None else driver.name,
        "kind": one.kind, "taken": one.taken, "with an event": "in an event" if one.with_event else "in none",
        "covered": float(holds.any()), "mass": mass, "top_right": float(holds[0]), "brier": (1.0 - mass) ** 2,
    }  # fmt: skip


def decision_cells(table: pl.DataFrame, *, seed: int) -> tuple[DecisionCell, ...]:
    """The cells of a table of decisions, kinds in order, each with everybody first."""
    found = []
    for kind in KINDS:
        own = table.filter(pl.col("kind") == kind)
        if own.is_empty():
            continue
        share = {taken: float((own["taken"] == taken).mean() or 0.0) for taken in own["taken"].unique().to_list()}
        own = own.with_columns((1.0 - pl.col("taken").replace_strict(share, return_dtype=pl.Float64)).alias("guess"))
        for by in CUTS:
            named = own.with_columns(pl.lit(ALL).alias("cell") if by == ALL else pl.col(by).alias("cell"))
            for value in sorted(named["cell"].unique().to_list(), key=value_order):
                found.append(_cell(named.filter(pl.col("cell") == value), kind, by, value, seed))
    return tuple(found)


def _cell(rows: pl.DataFrame, kind: str, by: str, value: str, seed: int) -> DecisionCell:
    drivers = rows.group_by(list(DRIVER)).agg(pl.col(MEASURES).mean(), (pl.col("guess") ** 2).mean()).sort(DRIVER)
    units = drivers["unit_id"].to_list()
    measures = {
        name: estimate(
            drivers[name].to_numpy(), units, seed=seed, purpose=f"decisions {kind} {by} {value} {name}",
            rate=name in ("covered", "top_right"),
        )
        for name in MEASURES
    }  # fmt: skip
    return DecisionCell(kind, by, value, rows.height, measures, float(drivers["guess"].to_numpy().mean()))
