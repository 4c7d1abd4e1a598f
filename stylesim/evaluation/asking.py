"""Asks a forecaster every window of a corpus and measures the answers: one row per (driver, t0)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Bool, Float32

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.metrics import METRICS, ForecastErrors, forecast_errors
from stylesim.forecast import Forecast, Forecaster, ForecastTask, Oracle, covered, earlier_s
from stylesim.scene import Scene
from stylesim.tracks import AgentKind
from stylesim.windows import WindowSpec, anchor_frames, earlier_scene, target_agents

STANDING_M = 1.0  # issue text: agents that move less than 1 m in the future are reported apart

WINDOW_SCHEMA: dict[str, Any] = {
    "scene_id": pl.String, "unit_id": pl.String, "source": pl.String, "scenario": pl.String, "agent_id": pl.String,
    "kind": pl.String, "commanded": pl.String, "t0_frame": pl.Int32, "standing": pl.Boolean,
    **dict.fromkeys(METRICS, pl.Float64), "best_probability": pl.Float64,
    "mode_probability": pl.List(pl.Float32),  # most probable first
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Question:
    """A task and what will be held against its answer; the forecaster sees `task` only."""

    task: ForecastTask
    truth_m: Float32[np.ndarray, "driver time 2"]
    valid: Bool[np.ndarray, "driver time"]
    standing: Bool[np.ndarray, " driver"]
    identity: tuple[dict[str, Any], ...]  # the columns that say who and where, one per driver


def _identity(scene: Scene, agent: int, t0: int) -> dict[str, Any]:
    driver = scene.tracks.driver[agent]
    return {
        "scene_id": scene.scene_id,
        "unit_id": scene.unit_id,
        "source": scene.source,
        "scenario": scene.scenario,
        "agent_id": scene.tracks.agent_id[agent],
        "kind": AgentKind(int(scene.tracks.kind[agent])).name.lower(),
        "commanded": "not commanded" if driver is None else driver.name,
        "t0_frame": t0,
    }


def questions(
    scene: Scene, spec: WindowSpec, counts: Counter[str], answering: Sequence[Forecaster] = ()
) -> Iterator[Question]:
    """The questions of one scene that all of `answering` can answer.

    `counts` gets what is asked and, with the reason, what is not.
    """
    history, future, _ = spec.steps(scene.tracks.dt_s)
    anchors = anchor_frames(scene, spec)
    remembered_s = earlier_s(answering)
    counts["scenes"] += 1
    counts["scenes too short for one window"] += not anchors
    for t0 in anchors:
        present = scene.tracks.history(t0, history).valid[:, -1]
        able = target_agents(scene, t0, spec, need_future=False)
        chosen = target_agents(scene, t0, spec)
        counts["not a motor vehicle"] += int((present & ~scene.tracks.is_motor).sum())
        counts["history too short"] += int((present & scene.tracks.is_motor).sum()) - len(able)
        counts["future incomplete"] += len(able) - len(chosen)
        past = scene.history(t0, history)
        known = covered(answering, ForecastTask(past, chosen, future, t0))
        if not known.all():
            counts["not forecast by all"] += int((~known).sum())
            chosen = chosen[known]
        counts["windows"] += len(chosen)
        if not len(chosen):
            continue
        ahead = slice(t0 + 1, t0 + 1 + future)
        truth, valid = scene.tracks.position_m[chosen, ahead], scene.tracks.valid[chosen, ahead]
        moved = np.linalg.norm(truth - scene.tracks.position_m[chosen, t0][:, None], axis=2)
        yield Question(
            task=ForecastTask(past, chosen, future, t0, earlier_scene(scene, t0, history, remembered_s)),
            truth_m=truth,
            valid=valid,
            standing=np.where(valid, moved, 0.0).max(axis=1) < STANDING_M,
            identity=tuple(_identity(scene, int(agent), t0) for agent in chosen),
        )


def reveal(forecaster: Forecaster, scene: Scene) -> None:
    """Tell the truth of a scene to a forecaster that is an oracle, and to no other."""
    if isinstance(forecaster, Oracle) and forecaster.sees_future:
        forecaster.reveal([scene])


def checked_answers(forecaster: Forecaster, tasks: Sequence[ForecastTask]) -> list[Forecast]:
    """What `forecaster` says to the tasks; InputError naming it where the answer is not what was asked for."""
    name = forecaster.name
    try:
        answers = forecaster.predict(tasks)
    except ValueError as error:
        raise InputError(f"forecaster {name!r} failed in predict(): {error}") from error
    if not isinstance(answers, Sequence) or len(answers) != len(tasks):
        got = f"{len(answers)} forecasts" if isinstance(answers, Sequence) else type(answers).__name__
        raise InputError(
            f"forecaster {name!r}: predict() must give one Forecast per task; {len(tasks)} asked, got {got}"
        )
    for task, answer in zip(tasks, answers, strict=True):
        where = f"forecaster {name!r}, scene {task.scene.scene_id!r}, t0 frame {task.t0_frame}"
        if not isinstance(answer, Forecast):
            raise InputError(f"{where}: predict() must give stylesim.forecast.Forecast, not {type(answer).__name__}")
        drivers, modes, steps = answer.mode_m.shape[:3]
        if drivers != len(task.agent_index):
            raise InputError(f"{where}: {len(task.agent_index)} drivers were asked, the forecast has {drivers}")
        if steps != task.future_steps:
            raise InputError(f"{where}: the forecast has {steps} steps, asked were {task.future_steps}")
        if modes < 1:
            raise InputError(f"{where}: the forecast has no mode")
    return answers


def _rows(question: Question, answer: Forecast, errors: ForecastErrors) -> Iterator[dict[str, Any]]:
    chance = -np.sort(-answer.probability, axis=1)
    for i, identity in enumerate(question.identity):
        measured = {name: float(getattr(errors, name)[i]) for name in (*METRICS, "best_probability")}
        yield {**identity, "standing": bool(question.standing[i]), **measured, "mode_probability": chance[i].tolist()}


def ask(
    forecaster: Forecaster,
    corpus: Corpus,
    *,
    spec: WindowSpec,
    modes: int,
    batch: int,
    beside: Sequence[Forecaster] = (),
    progress: Callable[[int, int], None] | None = None,
) -> tuple[pl.DataFrame, dict[str, int]]:
    """Every window of the corpus: (one row per driver and t0, counts of what was and was not asked).

    `batch` tasks go to the forecaster at a time; only their scenes are in memory. Whom the forecaster, or one of those
    `beside` it, has no answer for is not asked, and counted.
    """
    counts: Counter[str] = Counter()
    frames: list[pl.DataFrame] = []

    def every() -> Iterator[Question]:
        for done, scene in enumerate(corpus, start=1):
            reveal(forecaster, scene)
            yield from questions(scene, spec, counts, (forecaster, *beside))
            if progress is not None:
                progress(done, len(corpus))

    stream = every()
    while group := list(islice(stream, batch)):
        rows: list[dict[str, Any]] = []
        answers = checked_answers(forecaster, [question.task for question in group])
        for question, answer in zip(group, answers, strict=True):
            errors = forecast_errors(answer.mode_m, answer.probability, question.truth_m, question.valid, k=modes)
            rows.extend(_rows(question, answer, errors))
        frames.append(pl.DataFrame(rows, schema=WINDOW_SCHEMA))
    table = pl.concat(frames) if frames else pl.DataFrame(schema=WINDOW_SCHEMA)
    return table, dict(counts)
