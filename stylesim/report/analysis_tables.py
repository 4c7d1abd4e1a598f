"""Tables of `stylesim analyze`."""

from __future__ import annotations

import math
from typing import Any

from stylesim.evaluation.analysis.kinematics import QUANTITIES
from stylesim.evaluation.analysis.tables import Frame, where
from stylesim.report.tables import EM, Cell, Table, number

Row = dict[str, Any]


def value_cell(row: Row, *, value: str = "value", low: str = "low", high: str = "high", scale: float = 1.0) -> Cell:
    """A value over its interval; "too few" where refused, † where within site."""
    found = row[value]
    if found is None or not math.isfinite(found):
        return Cell(row["status"] or EM, look="refused")
    digits = 0 if scale == 100 else 2
    note = ""
    if row.get(low) is not None and math.isfinite(row[low]):
        note = f"[{number(scale * row[low], digits)}, {number(scale * row[high], digits)}]"
    within = row["status"] == "within site"
    return Cell(
        number(scale * found, digits), f"{note} †" if within and note else note, "within" if within else "number"
    )


def p_cell(p: float | None) -> Cell:
    """A p-value to two figures, or a bound."""
    if p is None:
        return Cell(EM, look="refused")
    return Cell("< 0.0001" if p < 1e-4 else f"{p:.2g}", look="number")


def size_cell(row: Row) -> Cell:
    """Drivers and units of a row."""
    return Cell(str(row["n_drivers"]), f"{row['n_units']} unit" + ("" if row["n_units"] == 1 else "s"), "number")


def firmness_table(table: Frame) -> Table:
    """Without neighbours, clamped, margins: one row per figure, a column per corpus."""
    corpora = list(dict.fromkeys(table["corpus"].to_list()))
    rows = []
    for figure in dict.fromkeys(table["figure"].to_list()):
        cells = []
        for corpus in corpora:
            row = where(table, corpus=corpus, figure=figure).row(0, named=True)
            cells.append(value_cell(row, scale=1.0 if figure.startswith("margin, ") else 100))
        rows.append((Cell(figure if figure.startswith("margin, ") else f"{figure} (%)", look="head"), *cells))
    return Table("How firm the classes are, with 95 % intervals", ("figure", *corpora), tuple(rows))


def pairs_table(table: Frame) -> Table:
    """The paper's tests, beside effect sizes."""
    rows = tuple(
        (
            Cell(row["corpus"], look="head"),
            Cell(QUANTITIES[row["quantity"]][0], row["circular"]),
            Cell(f"{row['first']} – {row['second']}", f"n = {row['n_first']}, {row['n_second']}"),
            p_cell(row["p"]), p_cell(row["p_holm"]),
            value_cell(row, value="delta", low="delta_low", high="delta_high"),
        )
        for row in table.iter_rows(named=True)
    )  # fmt: skip
    heads = ("corpus", "quantity", "classes", "p (Mann–Whitney)", "p (Holm)", "Cliff’s δ")
    return Table("Every two classes of 30 drivers or more, same tracks as the label: descriptive", heads, rows)


def halves_table(table: Frame) -> Table:
    """The judged test."""
    rows = []
    for row in table.iter_rows(named=True):
        who = Cell(f"{row['n_drivers']}", f"{row['scenes']} scenes, {row['left_out']} left out", "number")
        rows.append((
            Cell(row["corpus"], row["classes"] or "no two classes of 30", "head"),
            Cell(QUANTITIES[row["quantity"]][0]), who,
            p_cell(row["p"]), p_cell(row["p_holm"]),
            value_cell(row, value="delta", low="delta_low", high="delta_high"),
        ))  # fmt: skip
    heads = ("corpus", "of the second half", "drivers", "p (permutation)", "p (Holm)", "Cliff’s δ, boldest – calmest")
    return Table("Class of a track’s first half, kinematics of its second; permuted within scenes", heads, tuple(rows))


def stability_table(table: Frame) -> Table:
    """ICC and kappa by context."""
    rows = tuple(
        (Cell(row["corpus"], f"{row['window_s']:g} s windows", "head"), Cell(row["context"]), Cell(row["figure"]),
         size_cell(row), Cell(str(row["n_windows"]), look="number"), value_cell(row))
        for row in table.iter_rows(named=True)
    )  # fmt: skip
    heads = ("corpus", "context", "figure", "drivers", "windows", "value")
    return Table("Non-overlapping windows of one driver, by context", heads, rows)


def speed_table(table: Frame) -> Table:
    """Mean speed between clusters and between parts."""
    rows = tuple(
        (Cell(row["corpus"], look="head"), Cell(row["comparison"], row["of"]),
         Cell(f"{row['n_first']}, {row['n_second']}", look="number"), p_cell(row["p"]),
         value_cell(row, value="delta", low="delta_low", high="delta_high"))
        for row in table.iter_rows(named=True)
    )  # fmt: skip
    return Table(
        "Mean speed, which is not clustered by", ("corpus", "comparison", "n", "p (Mann–Whitney)", "Cliff’s δ"), rows
    )


def kdsc_tdbm_table(table: Frame) -> Table:
    """Share of KDSC's aggressive cluster in every TDBM class."""
    corpora = list(dict.fromkeys(table["corpus"].to_list()))
    rows = []
    for style in dict.fromkeys(table["class"].to_list()):
        cells = []
        for corpus in corpora:
            row = where(table, corpus=corpus, **{"class": style}).row(0, named=True)
            cell = value_cell(row, scale=1.0 if "V" in style else 100)
            cells.append(Cell(cell.text, f"{cell.note} n = {row['n_drivers']}".strip(), cell.look))
        rows.append((Cell(style if "V" in style else f"{style} (%)", look="head"), *cells))
    return Table("KDSC aggressive among the drivers of each TDBM class", ("TDBM class", *corpora), tuple(rows))


def sensitivity_table(table: Frame) -> Table:
    """What changes when the same drivers are measured or scaled otherwise."""
    rows = []
    for row in table.iter_rows(named=True):
        cells = [Cell(row["status"], look="refused")] * 4
        if row["same_class"] is not None:
            cells = [Cell(f"{100 * row['same_class']:.0f} %", look="number"), _plain(row["kappa"]),
                     _plain(row["a_change"]), Cell(f"{100 * row['largest_shift']:.0f} %", look="number")]  # fmt: skip
        who = Cell(str(row["n_drivers"]), f"{row['scenes']} of {row['of_scenes']} scenes", "number")
        rows.append((Cell(row["corpus"], look="head"), Cell(row["variant"]), who, *cells))
    heads = ("corpus", "variant", "drivers", "same class", "κ", "mean |Δa|", "largest change of a share")
    return Table("The same drivers, measured or scaled otherwise, against the default", heads, tuple(rows))


def _plain(value: float | None) -> Cell:
    return Cell(EM, look="refused") if value is None else Cell(number(value, 2), look="number")
