"""Two forecasters on the same windows of the same drivers: paired differences per cell."""

from __future__ import annotations

import numpy as np
import polars as pl

from stylesim.errors import InputError
from stylesim.evaluation.intervals import Estimate, paired_difference
from stylesim.evaluation.metrics import METRICS
from stylesim.evaluation.results import Evaluation
from stylesim.evaluation.slices import ALL, CROSS, value_order
from stylesim.evaluation.strata import DRIVER, column_of, parts_of

_SAME = ("history_s", "future_s", "stride_s", "modes", "miss_threshold_m", "standing_m")


def check_comparable(ours: Evaluation, theirs: Evaluation) -> None:
    """InputError, saying what differs, unless both answered the same questions about the same drivers."""
    pair = f"{ours.forecaster!r} and {theirs.forecaster!r} cannot be compared"
    if ours.about["corpus"]["fingerprint"] != theirs.about["corpus"]["fingerprint"]:
        raise InputError(f"{pair}: they were evaluated on different corpora")
    for name in _SAME:
        if ours.about[name] != theirs.about[name]:
            raise InputError(f"{pair}: {name} is {ours.about[name]} and {theirs.about[name]}")
    key = [*DRIVER, "n_windows", "n_standing"]
    if not ours.drivers.select(key).sort(DRIVER).equals(theirs.drivers.select(key).sort(DRIVER)):
        raise InputError(f"{pair}: they were asked about different drivers or windows (another split?)")


def differences(
    ours: Evaluation, theirs: Evaluation, by: str, *, seed: int = 0, within_site: bool = True
) -> dict[str, dict[str, Estimate]]:
    """`ours - theirs` per cell of `by` ("all" for all moving drivers) and metric; below 0 `ours` is better.

    A driver is in the cell of its columns in the driver table; for "history:…" that is the class of most of its
    windows. Raises InputError as `check_comparable`, or where an evaluation lacks the column.
    """
    check_comparable(ours, theirs)
    columns = [] if by == ALL else [column_of(part) for part in parts_of(by)]
    missing = [name for name in columns if name not in ours.drivers.columns]
    if missing:
        raise InputError(f"the evaluation of {ours.forecaster!r} has no column {missing[0]!r}; evaluate it by {by!r}")
    moving = pl.col("n_windows") > 0
    a = ours.drivers.filter(moving).sort(DRIVER)
    b = theirs.drivers.filter(moving).sort(DRIVER)
    named = a.select(pl.concat_str(columns, separator=CROSS) if columns else pl.lit(ALL).alias("cell"))
    cells = np.array(named.to_series().to_list() if columns else [ALL] * a.height, dtype=object)
    units = np.array(a["unit_id"].to_list(), dtype=object)
    found: dict[str, dict[str, Estimate]] = {}
    for value in sorted(set(cells.tolist()), key=value_order):
        inside = cells == value
        found[value] = {
            name: paired_difference(
                a[name].to_numpy()[inside],
                b[name].to_numpy()[inside],
                units[inside].tolist(),
                seed=seed,
                purpose=f"{by} {value} {name}",
                within_site=within_site,
            )
            for name in METRICS
        }
    return found
