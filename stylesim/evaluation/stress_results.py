"""What a stress test found about one forecaster, in memory and on disk."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.corpus.files import json_bytes, write_whole
from stylesim.errors import InputError
from stylesim.evaluation.conformal import ALPHA, Region
from stylesim.evaluation.reliability import Reliability
from stylesim.evaluation.results import Evaluation
from stylesim.evaluation.slices import Slice
from stylesim.evaluation.stress_decisions import SCHEMA, Decisions
from stylesim.evaluation.stress_groups import Degradation, WorstGroup
from stylesim.evaluation.stress_twins import TwinForecasts
from stylesim.evaluation.twin_shift import TwinShift

FORMAT = "stylesim-stress"
SCHEMA_VERSION = 2
SUFFIX = ".stress.json"
DECISIONS_SUFFIX = ".decisions.parquet"


@dataclass(frozen=True, eq=False)
class Coverage:
    """Conformal regions: radii from half of the episodes of `calibrated_on`, coverage on `judged_on`, by `by`."""

    by: str
    calibrated_on: str
    judged_on: str
    pooled_radius_m: float
    regions: tuple[Region, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "by": self.by, "calibrated_on": self.calibrated_on, "judged_on": self.judged_on, "alpha": ALPHA,
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
    criticality: tuple[Slice, ...]  # by the least time to collision, and by the deceleration needed, in the future
    decisions: Decisions
    twins: TwinForecasts | None = None  # switched at t0; None for traffic without such twins
    shift: TwinShift | None = None  # twins from the start

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
            "criticality": [one.to_dict() for one in self.criticality],
            "decisions": self.decisions.to_dict(),
            "twins": None if self.twins is None else self.twins.to_dict(),
            "twins_from_start": None if self.shift is None else self.shift.to_dict(),
        }

    def save(self, stem: str | Path) -> Path:
        """Write `<stem>.stress.json`; beside it the evaluation (.json, .md, .parquet) and the decisions.

        The same forecaster on the same traffic gives the same bytes; what depends on the machine is not in them.
        """
        path = Path(stem)
        self.evaluation.save(path.with_name(path.name + ".json"))
        rows = io.BytesIO()
        self.decisions.table.write_parquet(rows, compression="zstd", row_group_size=65536)
        write_whole(path.with_name(path.name + DECISIONS_SUFFIX), rows.getvalue())
        out = path.with_name(path.name + SUFFIX)
        write_whole(out, json_bytes(self.to_dict()))
        return out


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


def load_decisions(path: str | Path) -> pl.DataFrame:
    """The decisions that lie beside `<stem>.stress.json`, one row each; InputError if they are missing or damaged."""
    file = Path(path)
    table = file.with_name(file.name.removesuffix(SUFFIX) + DECISIONS_SUFFIX)
    try:
        found = pl.read_parquet(table)
    except FileNotFoundError:
        raise InputError(f"no such file: {table}; it is written beside {file.name}, keep both together") from None
    except (pl.exceptions.PolarsError, OSError) as error:
        raise InputError(f"{table} holds no decisions: {error}") from error
    if dict(found.schema) != SCHEMA:
        raise InputError(f"{table} holds no decisions of this version of stylesim")
    return found
