"""`stress`: one forecaster in edge-case traffic of every style. What it gets wrong, for whom, and whether it knows."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import polars as pl

from stylesim.errors import InputError
from stylesim.evaluation.conformal import regions_of
from stylesim.evaluation.evaluate import common_spec, how_asked
from stylesim.evaluation.metrics import MODES
from stylesim.evaluation.reliability import Reliability, reliability
from stylesim.evaluation.results import Evaluation
from stylesim.evaluation.slices import ALL, CROSS, Slice, all_slices, cell, driver_table, value_order
from stylesim.evaluation.strata import check_strata
from stylesim.evaluation.stress_corpora import EVERYDAY, RARE, StressTraffic
from stylesim.evaluation.stress_criticality import by_criticality
from stylesim.evaluation.stress_decisions import decisions
from stylesim.evaluation.stress_groups import degradation, worst_group
from stylesim.evaluation.stress_results import Coverage, Stress
from stylesim.evaluation.stress_twins import twin_forecasts
from stylesim.evaluation.stress_windows import EVENT, NO_EVENT, POPULATION, stress_windows, traffic_facts
from stylesim.evaluation.twin_shift import twin_shift
from stylesim.forecast import Forecaster
from stylesim.randomness import stream
from stylesim.windows import WindowSpec

STYLE = "commanded"
BY = (STYLE, "scenario", f"{STYLE}*scenario")


def stress(
    forecaster: Forecaster,
    traffic: StressTraffic,
    *,
    spec: WindowSpec | None = None,
    seed: int = 0,
    modes: int = MODES,
    beside: Sequence[Forecaster] = (),
    progress: Callable[[str, int, int], None] | None = None,
) -> Stress:
    """Hold `forecaster` against the traffic of `stress_corpora`; `beside` as in `evaluate`.

    Styles are the commanded ones. Windows of drivers who caused an event are listed under that event and nowhere else,
    because what they did was not their style. `seed` is of the bootstrap, of the halves and of the drawn windows.
    InputError where no window can be asked, or an answer is not what was asked for.
    """
    asked = spec or WindowSpec()
    spec = common_spec((forecaster, *beside), asked)
    for corpora in traffic.populations.values():
        for corpus in corpora:
            check_strata(corpus, BY)
    windows, counts, provenance = stress_windows(
        forecaster, traffic, by=BY, spec=spec, modes=modes, beside=beside, progress=progress
    )
    caused = pl.col(EVENT).str.ends_with(", actor")
    judged = windows.filter(~caused)
    if judged.is_empty():
        raise InputError(f"the traffic has no window of {spec.history_s:g} s + {spec.future_s:g} s to ask")
    moving = judged.filter(~pl.col("standing"))
    cells = all_slices(judged, BY, seed=seed, within_site=True)
    crossed = tuple(one for one in cells if one.by == BY[-1])
    about = how_asked(traffic_facts(traffic), spec, provenance, seed=seed, modes=modes)
    evaluation = Evaluation(
        forecaster.name, BY, cells, driver_table(judged), about | {"asked_future_s": asked.future_s}, counts
    )
    return Stress(
        evaluation=evaluation,
        events=_by_event(windows.filter(~pl.col("standing")), seed),
        worst=worst_group(moving, crossed, BY[-1], seed=seed),
        degradation=degradation(moving, seed=seed),
        reliability=_reliabilities(moving, seed, modes),
        coverage=_coverages(moving, traffic, seed),
        criticality=by_criticality(moving, seed=seed),
        decisions=decisions(forecaster, traffic.populations, spec=spec, modes=modes, seed=seed, beside=beside),
        twins=twin_forecasts(forecaster, traffic.twins, spec=spec, modes=modes, seed=seed, beside=beside),
        shift=twin_shift(forecaster, traffic.twins, spec=spec, seed=seed, beside=beside),
    )


def _by_event(moving: pl.DataFrame, seed: int) -> tuple[Slice, ...]:
    names = sorted(set(moving[EVENT].to_list()), key=lambda name: (name == NO_EVENT, name))
    return tuple(
        cell(moving.filter(pl.col(EVENT) == name), by=EVENT, value=name, seed=seed, within_site=True) for name in names
    )


def _reliabilities(moving: pl.DataFrame, seed: int, modes: int) -> tuple[Reliability, ...]:
    styles = sorted(set(moving[STYLE].to_list()), key=value_order)
    groups = [(ALL, moving), *((style, moving.filter(pl.col(STYLE) == style)) for style in styles)]
    found = (reliability(windows, group=name, seed=seed, modes=modes) for name, windows in groups)
    return tuple(one for one in found if one is not None)


def _coverages(moving: pl.DataFrame, traffic: StressTraffic, seed: int) -> tuple[Coverage, ...]:
    """Within each population by halves of its episodes; and everyday regions held against rare traffic.

    By style, and by style × scenario.
    """
    scores = moving.select(
        "unit_id", "agent_id", POPULATION, STYLE, pl.concat_str(STYLE, "scenario", separator=CROSS).alias(BY[-1]),
        pl.col("min_fde_m").alias("score"),
    )  # fmt: skip
    units = np.array(sorted(scores["unit_id"].unique().to_list()), dtype=object)
    half: list[str] = []
    for population in sorted(scores[POPULATION].unique().to_list()):
        own = [unit for unit in units if unit.startswith(f"{population}:")]
        order = stream(seed, 0, "", f"conformal halves {population}").permutation(len(own))
        half += [own[i] for i in order[: (len(own) + 1) // 2]]
    first = scores.filter(pl.col("unit_id").is_in(half))
    second = scores.filter(~pl.col("unit_id").is_in(half))
    pairs = [(name, name) for name in traffic.populations]
    pairs += [(EVERYDAY, RARE)] if traffic.paired else []
    found = []
    for calibrated, judged in pairs:
        known, test = (
            side.filter(pl.col(POPULATION) == name) for side, name in ((first, calibrated), (second, judged))
        )
        if known.is_empty() or test.is_empty():
            continue
        for by in (STYLE, BY[-1]):
            sides = (side.with_columns(pl.col(by).alias("group")) for side in (known, test))
            regions, pooled = regions_of(*sides, seed=seed)
            found.append(Coverage(by, calibrated, judged, pooled, regions))
    return tuple(found)
