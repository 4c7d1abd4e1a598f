"""`stress`: one forecaster in edge-case traffic of every style. What it gets wrong, for whom, and whether it knows."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.corpus.files import json_bytes, write_whole
from stylesim.errors import InputError
from stylesim.evaluation.conformal import ALPHA, Region, regions_of
from stylesim.evaluation.evaluate import common_spec, how_asked
from stylesim.evaluation.metrics import MODES
from stylesim.evaluation.reliability import Reliability, reliability
from stylesim.evaluation.results import Evaluation
from stylesim.evaluation.slices import ALL, Slice, all_slices, cell, driver_table, value_order
from stylesim.evaluation.strata import check_strata
from stylesim.evaluation.stress_corpora import EVERYDAY, RARE, StressTraffic
from stylesim.evaluation.stress_groups import Degradation, WorstGroup, degradation, worst_group
from stylesim.evaluation.stress_twins import TwinForecasts, twin_forecasts
from stylesim.evaluation.stress_windows import EVENT, NO_EVENT, POPULATION, stress_windows, traffic_facts
from stylesim.forecast import Forecaster
from stylesim.randomness import stream
from stylesim.windows import WindowSpec

FORMAT = "stylesim-stress"
SCHEMA_VERSION = 1
STYLE = "commanded"
BY = (STYLE, "scenario", f"{STYLE}*scenario")
SUFFIX = ".stress.json"


@dataclass(frozen=True, eq=False)
class Coverage:
    """Conformal regions: radii from half of the episodes of `calibrated_on`, coverage on `judged_on`, by style."""

    calibrated_on: str
    judged_on: str
    pooled_radius_m: float
    regions: tuple[Region, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "calibrated_on": self.calibrated_on, "judged_on": self.judged_on, "alpha": ALPHA,
            "pooled_radius_m": self.pooled_radius_m if np.isfinite(self.pooled_radius_m) else None,
            "regions": [one.to_dict() for one in self.regions],
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Stress:
    """What one forecaster did. `evaluation` has every cell's accuracy, the drivers, what was asked and what was not."""

    evaluation: Evaluation
    events: tuple[Slice, ...]  # by event, those who caused it apart
    worst: WorstGroup | None
    degradation: tuple[Degradation, ...]  # () for a corpus of one population
    reliability: tuple[Reliability, ...]  # everybody, then by style; () for a forecaster of one mode
    coverage: tuple[Coverage, ...]
    twins: TwinForecasts | None = None  # None for traffic without twins

    @property
    def forecaster(self) -> str:
        """Its name."""
        return self.evaluation.forecaster

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values: all that the page shows."""
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "forecaster": self.forecaster,
            "accuracy": self.evaluation.to_dict(),
            "events": [one.to_dict() for one in self.events],
            "worst_group": None if self.worst is None else self.worst.to_dict(),
            "degradation": [one.to_dict() for one in self.degradation],
            "reliability": [one.to_dict() for one in self.reliability],
            "coverage": [one.to_dict() for one in self.coverage],
            "twins": None if self.twins is None else self.twins.to_dict(),
        }

    def save(self, stem: str | Path) -> Path:
        """Write `<stem>.stress.json`, and the evaluation's .json, .md and .parquet beside it (`compare` reads them)."""
        path = Path(stem)
        self.evaluation.save(path.with_name(path.name + ".json"))
        out = path.with_name(path.name + SUFFIX)
        write_whole(out, json_bytes(self.to_dict()))
        return out


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
        twins=twin_forecasts(forecaster, traffic.twins, spec=spec, modes=modes, seed=seed, beside=beside),
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
    """Within each population by halves of its episodes; and everyday regions held against rare traffic."""
    scores = moving.select(
        "unit_id", "agent_id", POPULATION, pl.col(STYLE).alias("group"), pl.col("min_fde_m").alias("score")
    )
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
        if not (known.is_empty() or test.is_empty()):
            regions, pooled = regions_of(known, test, seed=seed)
            found.append(Coverage(calibrated, judged, pooled, regions))
    return tuple(found)


def load_stress(path: str | Path) -> Mapping[str, Any]:
    """What `Stress.save` wrote, as plain values; InputError if it is no such file."""
    file = Path(path)
    try:
        raw = json.loads(file.read_text(encoding="utf-8"))
        if raw["format"] != FORMAT or int(raw["schema_version"]) > SCHEMA_VERSION:
            raise InputError(f"{file} is no stress test that this version of stylesim can read")
    except FileNotFoundError:
        raise InputError(f"no such file: {file}") from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{file} is no stress test: {error!r}") from error
    found: Mapping[str, Any] = raw
    return found
