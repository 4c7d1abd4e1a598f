"""`run_experiment`: every arm with every seed, trained for the same steps and asked about the same drivers."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.experiments.arms import PERMUTED_ARM, Arm, Request, check_arms
from stylesim.experiments.records import Run, read_runs, write_run
from stylesim.experiments.remembering import JudgeShelf
from stylesim.experiments.results import Experiment
from stylesim.forecast import Forecaster
from stylesim.windows import WindowSpec

MODELS = "models"


def run_experiment(
    arms: Sequence[Arm],
    *,
    corpus: Corpus,
    seeds: Sequence[int],
    steps: int,
    out: str | Path,
    test: Corpus | None = None,
    splits: Sequence[str] = ("val", "test"),
    size: str = "tiny",
    spec: WindowSpec = WindowSpec(),
    batch_size: int = 32,
    cache: Path | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Experiment:
    """Train every arm with every seed for `steps` batches; evaluate each on the `splits` of `test`.

    All arms of a seed have the same start weights (where they have the same layers), the same order of samples (where
    they have the same weights of samples) and the same number of steps; the best epoch on "val" counts. `test` is
    `corpus` where None; an arm may train on a corpus of its own. The folder `out` grows by one line per finished run;
    the same call again goes on where it was stopped, and two processes may share it if they have different seeds.
    `progress` is called with a run's name, the runs done and their number.

    Returns all finished runs of the folder, those of other calls with it. InputError for a folder that was begun
    otherwise, an arm that was run with other options, names given twice, or what `train` and `evaluate` refuse.
    """
    check_arms(arms, seeds)
    if steps < 1:
        raise InputError(f"steps must be 1 or more, not {steps}")
    out, judged = Path(out), corpus if test is None else test
    for split in splits:
        judged.split(split)  # refused before any work
    request = Request(corpus.fingerprint, judged.fingerprint, tuple(splits), steps, batch_size, size, spec)
    request.open(out)
    done = read_runs(out)
    for arm in arms:
        _same(arm, [run for run in done.values() if run.arm == arm.name], out)
    shelf = JudgeShelf()
    # seed by seed, so that what is stopped early has whole pairs
    todo = [(seed, arm) for seed in seeds for arm in arms if (arm.name, seed) not in done]
    total = len(seeds) * len(arms)
    for number, (seed, arm) in enumerate(todo, start=total - len(todo)):
        if progress is not None:
            progress(f"{arm.name}, seed {seed}", number, total)
        trained_on = arm.corpus or corpus
        _one(arm, shelf.options(arm, trained_on, spec), seed, request, trained_on, judged, out, cache)
    if progress is not None:
        progress("done", total, total)
    return Experiment.load(out)


def _same(arm: Arm, runs: Sequence[Run], out: Path) -> None:
    for run in runs:
        if run.facts != arm.facts():
            raise InputError(
                f"{out}: arm {arm.name!r} was run with {run.facts}, not {arm.facts()}; name it otherwise, or use "
                "another folder"
            )


def _one(
    arm: Arm,
    options: Mapping[str, Any],
    seed: int,
    request: Request,
    corpus: Corpus,
    judged: Corpus,
    out: Path,
    cache: Path | None,
) -> None:
    """Train one arm with one seed, evaluate it, and write what came of it; the arm's own line last."""
    from stylesim.evaluation.permuted import permuted
    from stylesim.forecasting.checkpoint import RECORD_FILE
    from stylesim.forecasting.training import train

    begin_s, begin_cpu_s = time.perf_counter(), time.process_time()
    folder = out / MODELS / f"{arm.name}.{seed}"
    model = train(
        corpus,
        **options,
        seed=seed,
        out=folder,
        spec=request.spec,
        size=request.size,
        batch_size=request.batch_size,
        max_steps=request.steps,
        epochs=request.steps,  # as many as there can be: only the steps end it
        patience=request.steps,
        cache=cache,
        resume=True,
    )
    record = json.loads((folder / RECORD_FILE).read_bytes())
    measured = {
        "steps": int(record["curve"][-1]["step"]),
        "parameters": int(record["parameters"]),
        "best_epoch": int(record["best_epoch"]),
        "style_effect_m": record["curve"][record["best_epoch"]].get("style_effect_m"),
        "training_samples": int(record["samples"]["train"]),
        "train_s": time.perf_counter() - begin_s,
        "train_cpu_s": time.process_time() - begin_cpu_s,
    }
    if arm.permuted:
        by_split = {
            split: permuted(model, judged.split(split), spec=request.spec, seed=seed) for split in request.splits
        }
        found, tables = _judged(by_split, request, judged)
        write_run(out, Run(f"{arm.name}{PERMUTED_ARM}", seed, arm.facts(), measured | found), tables)
    found, tables = _judged(dict.fromkeys(request.splits, model), request, judged)
    write_run(out, Run(arm.name, seed, arm.facts(), measured | found), tables)


def _judged(
    models: Mapping[str, Forecaster], request: Request, judged: Corpus
) -> tuple[dict[str, Any], dict[str, pl.DataFrame]]:
    """What was measured of the forecaster of each split, and its drivers."""
    from stylesim.evaluation.evaluate import evaluate

    begin_cpu_s = time.process_time()
    tables, means = {}, {}
    for split, model in models.items():
        tables[split] = evaluate(model, judged, by=(), spec=request.spec, split=split).drivers
        moving = tables[split].filter(pl.col("n_windows") > 0)
        means[split] = {"drivers": moving.height, "min_fde_m": moving["min_fde_m"].mean()}
    return {"evaluate_cpu_s": time.process_time() - begin_cpu_s, "means": means}, tables
