"""Loss accounting: rows in = rows out + rows dropped, by stated reason.

A reader puts these numbers into `Scene.counts`; what belongs to no scene (a row without a readable time) is
counted in the first scene of its recording.
"""

from __future__ import annotations

from collections.abc import Mapping

from stylesim.errors import StylesimError

ROWS_IN = "rows_in"
ROWS_OUT = "rows_out"
DROPPED = "rows_dropped_"


class AccountingError(StylesimError):
    """A reader lost rows without saying why: a defect of the reader, not of the data."""

    exit_code = 70


def row_counts(
    *, rows_out: int, dropped: Mapping[str, int] | None = None, rows_in: int | None = None
) -> dict[str, int]:
    """The counts of a scene that kept `rows_out` source rows and dropped `dropped` (reason -> rows).

    `rows_in` is what the reader counted in the source. Raises AccountingError where rows vanished unsaid.
    """
    lost = {DROPPED + reason: int(n) for reason, n in (dropped or {}).items() if n}
    if rows_in is not None and rows_in != rows_out + sum(lost.values()):
        raise AccountingError(f"{rows_in} rows in, but {rows_out} out and dropped: {lost}")
    return {ROWS_IN: int(rows_out) + sum(lost.values()), ROWS_OUT: int(rows_out), **lost}


def added(total: Mapping[str, int], more: Mapping[str, int]) -> dict[str, int]:
    """The key-wise sum of two sets of counts, keys sorted."""
    return {key: int(total.get(key, 0)) + int(more.get(key, 0)) for key in sorted({*total, *more})}


def checked(counts: Mapping[str, int], *, steps: int, where: str) -> None:
    """Hold the counts of a whole corpus against each other and against what was written.

    `steps` is the number of valid agent-frames. Raises AccountingError where rows vanished unsaid.
    """
    lost = sum(n for key, n in counts.items() if key.startswith(DROPPED))
    rows_in, rows_out = counts.get(ROWS_IN, 0), counts.get(ROWS_OUT, 0)
    if rows_in != rows_out + lost:
        raise AccountingError(f"{where}: {rows_in} rows in, but {rows_out} out and {lost} dropped by stated reason")
    if rows_out != steps:
        raise AccountingError(f"{where}: {rows_out} rows counted as kept, but {steps} agent-frames were written")
