"""Tables of the report as plain values; the template only lays them out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from stylesim.evaluation.compare import differences
from stylesim.evaluation.intervals import Estimate
from stylesim.evaluation.label_summary import FRAGILE_MARGIN, LabelSummary
from stylesim.evaluation.metrics import METRICS
from stylesim.evaluation.results import HEADINGS, Evaluation
from stylesim.evaluation.slices import ALL, STANDING, Slice, value_order
from stylesim.evaluation.strata import title_of
from stylesim.report.figures import cell_values
from stylesim.report.theme import plural

EM = "–"


@dataclass(frozen=True)
class Cell:
    """One cell: its text, a smaller second line, a class for its look, and how many rows it spans."""

    text: str
    note: str = ""
    look: str = ""  # "", "number", "refused", "within", "better", "worse", "head"
    rows: int = 1


@dataclass(frozen=True)
class Table:
    """A table with a caption that says what its numbers are."""

    caption: str
    headings: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


def grouped(rows: Sequence[tuple[Cell, ...]]) -> tuple[tuple[Cell, ...], ...]:
    """Rows below one another that begin with the same cell: it is written once and spans them."""
    found: list[tuple[Cell, ...]] = []
    for lead, group in groupby(rows, key=lambda row: row[0]):
        members = list(group)
        found.append((replace(lead, rows=len(members)), *members[0][1:]))
        found += [row[1:] for row in members[1:]]
    return tuple(found)


def number(value: float, digits: int) -> str:
    """`value` with a real minus sign, and none before a zero."""
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text.replace("-", "−")


def size_text(size: Estimate) -> str:
    """How many drivers of how many units, and whether the interval is of this site only."""
    mark = ", † within site" if size.status == "within site" else ""
    return f"{plural(size.n_drivers, 'driver')}, {plural(size.n_units, 'unit')}{mark}"


def estimate_cell(value: Estimate | None, *, judge: bool = False, digits: int = 2) -> Cell:
    """`1.63` over `[1.20, 2.10]`; "too few" where refused, † where within site.

    `judge` marks intervals that exclude 0, but no difference that is 0 as printed: rounding errors have a sign, too.
    """
    if value is None:
        return Cell(EM, look="refused")
    if value.refused:
        return Cell("too few", look="refused")
    note = f"[{number(value.low, digits)}, {number(value.high, digits)}]"
    if value.status == "within site":
        return Cell(number(value.value, digits), f"{note} †", "within")
    differs = judge and value.excludes_zero and round(value.value, digits) != 0
    look = ("better" if value.high < 0 else "worse") if differs else "number"
    return Cell(number(value.value, digits), note, look)


def _lookup(evaluation: Evaluation, by: str) -> Mapping[str, Slice]:
    known = by in (ALL, STANDING, *evaluation.by)
    return {item.value: item for item in evaluation.slices_by(by)} if known else {}


def error_table(evaluations: Sequence[Evaluation], by: str) -> Table:
    """All metrics per value of `by`, forecasters below one another within a value."""
    found = [(one.forecaster, _lookup(one, by)) for one in evaluations]
    found = [(name, cells) for name, cells in found if cells]
    values = [by] if by in (ALL, STANDING) else cell_values(evaluations, by)
    rows: list[tuple[Cell, ...]] = []
    for value in values:
        present = [(name, cells[value]) for name, cells in found if value in cells]
        sizes = {(item.size.n_drivers, item.size.n_units) for _, item in present}
        for place, (name, item) in enumerate(present):
            n = size_text(item.size)
            lead = (
                []
                if place
                else [Cell(value.replace(ALL, "all drivers"), n if len(sizes) == 1 else "", "head", len(present))]
            )
            own = Cell(name, "" if len(sizes) == 1 else n)
            rows.append((*lead, own, *(estimate_cell(item.metrics[metric]) for metric in METRICS)))
    what = {ALL: "All drivers that move", STANDING: "Agents that stand (< 1 m in the future), in no other table"}
    caption = f"{what.get(by, f'By {title_of(by)}')}: mean over drivers, 95 % interval below."
    return Table(
        caption,
        ("" if by in (ALL, STANDING) else title_of(by), "forecaster", *(HEADINGS[metric] for metric in METRICS)),
        tuple(rows),
    )


def difference_table(evaluations: Sequence[Evaluation], by: str, *, seed: int) -> Table | None:
    """Every other forecaster minus the first, paired by driver; None with fewer than two of one corpus.

    Only evaluations of the first one's corpus can be paired and are shown.
    """
    baseline = evaluations[0] if evaluations else None
    if baseline is None or (by != ALL and by not in baseline.by):
        return None
    mark = baseline.about["corpus"]["fingerprint"]
    others = [
        one for one in evaluations[1:] if one.about["corpus"]["fingerprint"] == mark and (by == ALL or by in one.by)
    ]
    if not others:
        return None
    found = [(one.forecaster, differences(one, baseline, by, seed=seed)) for one in others]
    rows: list[tuple[Cell, ...]] = []
    for value in sorted({value for _, cells in found for value in cells}, key=value_order):
        for place, (name, cells) in enumerate(found):
            size = cells[value][METRICS[0]]
            n = size_text(size)
            lead = [] if place else [Cell(value.replace(ALL, "all drivers"), n, "head", len(found))]
            rows.append(
                (*lead, Cell(name), *(estimate_cell(cells[value][metric], judge=True, digits=3) for metric in METRICS))
            )
    caption = f"Difference to {baseline.forecaster}, same drivers: below 0 is better; 95 % interval of the paired mean."
    return Table(
        caption, ("" if by == ALL else title_of(by), "forecaster", *(f"Δ {HEADINGS[m]}" for m in METRICS)), tuple(rows)
    )


def percent(share: float) -> Cell:
    """A share in percent, or a dash where it is not known."""
    return Cell(f"{100 * share:.0f} %" if math.isfinite(share) else EM, look="number")


def label_table(summaries: Sequence[LabelSummary]) -> Table:
    """What could not be judged, and how firm the labels are, per corpus and source."""
    rows = []
    for summary in summaries:
        for one in summary.sources:
            low, middle, high = one.margin_quartiles
            margin = f"{middle:.2f}" if math.isfinite(middle) else EM
            rows.append(
                (
                    Cell(one.source, summary.corpus, "head"),
                    Cell(summary.method),
                    Cell(f"{one.n}", plural(one.n_units, "unit"), "number"),
                    percent(one.share("undetermined")),
                    percent(one.no_neighbours),
                    percent(one.no_leader),
                    percent(one.clamped),
                    Cell(margin, f"{low:.2f} to {high:.2f}" if math.isfinite(low) else "", "number"),
                    percent(one.fragile),
                )
            )
    headings = ("source", "method", "tracks", "undetermined", "no neighbours", "no leader", "a feature clamped")
    margins = ("margin, median and quartiles", f"margin under {FRAGILE_MARGIN}")
    caption = "Labels of whole tracks. The margin is the best score minus the second best: in the method's own units."
    return Table(caption, (*headings, *margins), tuple(rows))


def facts_table(caption: str, facts: Mapping[str, object]) -> Table:
    """Names and values."""
    return Table(caption, (), tuple((Cell(name, look="head"), Cell(str(value))) for name, value in facts.items()))
