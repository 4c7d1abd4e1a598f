"""Argoverse 2 prediction files: the Parquet that av2's `ChallengeSubmission.to_parquet` writes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.errors import InputError
from stylesim.forecasting.predictions import ANY_T0, Key, PredictionFile, collected

DT_S = 0.1  # Argoverse 2: 60 points at 10 Hz, the first 0.1 s after t0
COLUMNS = ("scenario_id", "track_id", "probability", "predicted_trajectory_x", "predicted_trajectory_y")
T0_COLUMN = "t0_frame"  # ours, for corpora whose scenes have more than one t0
DT_COLUMN, UNIT_COLUMN = "dt_s", "unit_m"  # ours, for predictions at another rate, or in feet (0.3048); one per file


def av2_predictions(path: Path) -> PredictionFile:
    """The predictions in that file. InputError naming the column or row that does not fit."""
    try:
        table = pl.read_parquet(path)
    except (pl.exceptions.PolarsError, OSError) as error:
        raise InputError(f"{path} is no Parquet file that can be read: {error}") from None
    for column in COLUMNS:
        if column not in table.columns:
            raise InputError(f"{path}: the column {column!r} is missing; an Argoverse 2 submission has {COLUMNS}")
    if table.null_count().sum_horizontal().sum():
        raise InputError(f"{path}: some cells are empty")
    dt_s, unit_m = _one_number(table, path, DT_COLUMN, DT_S), _one_number(table, path, UNIT_COLUMN, 1.0)
    return PredictionFile(path.stem, collected(_rows(table, path, unit_m), where=str(path)), dt_s=dt_s)


def _one_number(table: pl.DataFrame, path: Path, column: str, usual: float) -> float:
    """The number that a column of ours holds in every row; `usual` without the column."""
    if column not in table.columns:
        return usual
    values = table[column].unique().to_list()
    if len(values) != 1 or not isinstance(values[0], int | float) or not 0 < values[0] < np.inf:
        raise InputError(f"{path}: the column {column!r} must hold one positive number, the same in every row")
    return float(values[0])


def _rows(table: pl.DataFrame, path: Path, unit_m: float) -> Iterator[tuple[Key, Float64[np.ndarray, "step 2"], float]]:
    has_t0 = T0_COLUMN in table.columns
    for row in table.iter_rows(named=True):
        try:
            x = np.asarray(row["predicted_trajectory_x"], np.float64)
            y = np.asarray(row["predicted_trajectory_y"], np.float64)
            chance = float(row["probability"])
            t0 = int(row[T0_COLUMN]) if has_t0 else ANY_T0
        except (TypeError, ValueError) as error:
            raise InputError(f"{path}: scenario {row['scenario_id']!r}: {error}") from None
        if x.ndim != 1 or x.shape != y.shape:
            raise InputError(f"{path}: scenario {row['scenario_id']!r}: x and y differ in length")
        yield (str(row["scenario_id"]), str(row["track_id"]), t0), np.stack([x, y], axis=1) * unit_m, chance
