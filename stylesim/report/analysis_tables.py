"""Tables of `stylesim analyze`: a row per corpus, however many there are; who has too few drivers is named below."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from stylesim.evaluation.analysis.kinematics import QUANTITIES
from stylesim.evaluation.analysis.shares import NAMES
from stylesim.evaluation.analysis.tables import Frame, known, where
from stylesim.report.tables import EM, Cell, Table, number

Row = dict[str, Any]


def corpora_of(table: Frame) -> list[str]:
    """The corpora of a table, in its order."""
    return list(dict.fromkeys(table["corpus"].to_list()))


def without(names: Iterable[str], *, why: str = "too few drivers") -> str:
    """A sentence that names the corpora of which a table says nothing; empty without any."""
    listed = ", ".join(names)
    return f" Nothing can be said of {listed}: {why}." if listed else ""


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


def p_text(p: float | None) -> str:
    """A p-value to two figures, or a bound."""
    if p is None:
        return EM
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"


def _p_cell(p: float | None) -> Cell:
    return Cell(p_text(p), look="refused" if p is None else "number")


def _head(row: Row) -> Cell:
    return Cell(row["corpus"], f"n = {row['n_drivers']}", "head")


def shares_table(table: Frame, orientation: str, title: str) -> Table:
    """Share of each class (%), a row per corpus."""
    own = where(table, orientation=orientation)
    said = known(own, "value")
    rows = []
    for corpus in corpora_of(said):
        cells = {row["class"]: row for row in where(said, corpus=corpus).iter_rows(named=True)}
        rows.append((_head(cells[NAMES[0]]), *(value_cell(cells[name], scale=100) for name in NAMES)))
    silent = without(c for c in corpora_of(own) if c not in corpora_of(said))
    return Table(f"{title}: share of each class (%), 95 % intervals.{silent}", ("corpus", *NAMES), tuple(rows))


def firmness_table(table: Frame) -> Table:
    """Without neighbours, clamped, margins: a row per corpus."""
    said = known(table, "value")
    figures = [f for f in dict.fromkeys(table["figure"].to_list()) if f in set(said["figure"].to_list())]
    rows = []
    for corpus in corpora_of(said):
        own = {row["figure"]: row for row in where(table, corpus=corpus).iter_rows(named=True)}
        cells = [value_cell(own[f], scale=1.0 if f.startswith("margin, ") else 100) for f in figures]
        rows.append((Cell(corpus, look="head"), *cells))
    short = [f.replace(" among those without neighbours", " if alone") for f in figures]
    heads = tuple(f if f.startswith("margin, ") else f"{f} (%)" for f in short)
    silent = without(c for c in corpora_of(table) if c not in corpora_of(said))
    return Table(f"How firm the classes are, 95 % intervals.{silent}", ("corpus", *heads), tuple(rows))


def pairs_table(table: Frame) -> Table:
    """The paper's tests, beside effect sizes."""
    rows = tuple(
        (
            Cell(row["corpus"], look="head"),
            Cell(QUANTITIES[row["quantity"]][0], row["circular"]),
            Cell(f"{row['first']} – {row['second']}", f"n = {row['n_first']}, {row['n_second']}"),
            _p_cell(row["p"]), _p_cell(row["p_holm"]),
            value_cell(row, value="delta", low="delta_low", high="delta_high"),
        )
        for row in table.iter_rows(named=True)
    )  # fmt: skip
    heads = ("corpus", "quantity", "classes", "p (Mann–Whitney)", "p (Holm)", "Cliff’s δ")
    return Table("Every two classes of 30 drivers or more, same tracks as the label: descriptive", heads, rows)


def halves_table(table: Frame) -> Table:
    """The judged test: δ of the boldest against the calmest class, with its interval and p after Holm."""
    said = known(table, "p_holm")
    rows = []
    for corpus in corpora_of(said):
        own = {row["quantity"]: row for row in where(said, corpus=corpus).iter_rows(named=True)}
        first = next(iter(own.values()))
        who = f"{first['classes']}; n = {first['n_drivers']} in {first['scenes']} scenes, {first['left_out']} left out"
        cells = []
        for row in own.values():
            cell = value_cell(row, value="delta", low="delta_low", high="delta_high")
            cells.append(Cell(cell.text, f"{cell.note} p = {p_text(row['p_holm'])}".replace("= <", "<"), cell.look))
        rows.append((Cell(corpus, who, "head"), *cells))
    silent = without((c for c in corpora_of(table) if c not in corpora_of(said)), why="no two classes of 30 drivers")
    title = (
        "Class of a track’s first half, kinematics of its second: Cliff’s δ, boldest – calmest class, and p "
        f"(permutation within scenes, Holm over the quantities).{silent}"
    )
    return Table(title, ("corpus", *(QUANTITIES[q][0] for q in QUANTITIES)), tuple(rows))


def stability_table(table: Frame) -> Table:
    """ICC and kappa: a row per corpus, length of window and context."""
    said = known(table, "value")
    figures = list(dict.fromkeys(table["figure"].to_list()))
    rows = []
    for corpus, window, context in dict.fromkeys(said.select("corpus", "window_s", "context").iter_rows()):
        own = {row["figure"]: row for row in where(table, corpus=corpus, window_s=window, context=context)
               .iter_rows(named=True)}  # fmt: skip
        first = next(iter(own.values()))
        who = f"n = {first['n_drivers']}, {first['n_windows']} windows"
        rows.append((Cell(corpus, who, "head"), Cell(f"{window:g} s"), Cell(context), *map(value_cell, own.values())))
    silent = without(c for c in corpora_of(table) if c not in corpora_of(said))
    title = f"Non-overlapping windows of one driver, by context.{silent}"
    return Table(title, ("corpus", "windows", "context", *figures), tuple(rows))


def speed_table(table: Frame) -> Table:
    """Mean speed between clusters and between parts, where both sides have 30 drivers."""
    said = known(table, "delta")
    rows = tuple(
        (Cell(row["corpus"], look="head"), Cell(row["comparison"], row["of"]),
         Cell(f"{row['n_first']}, {row['n_second']}", look="number"), _p_cell(row["p"]),
         value_cell(row, value="delta", low="delta_low", high="delta_high"))
        for row in said.iter_rows(named=True)
    )  # fmt: skip
    left = table.height - said.height
    silent = f" {left} of {table.height} comparisons have under 30 drivers on a side and are not made." if left else ""
    heads = ("corpus", "comparison", "n", "p (Mann–Whitney)", "Cliff’s δ")
    return Table(f"Mean speed, which is not clustered by.{silent}", heads, rows)


def kdsc_tdbm_table(table: Frame) -> Table:
    """Share of KDSC's aggressive cluster in every TDBM class, a row per corpus."""
    said = known(table, "value")
    classes = list(dict.fromkeys(table["class"].to_list()))
    rows = []
    for corpus in corpora_of(said):
        own = {row["class"]: row for row in where(table, corpus=corpus).iter_rows(named=True)}
        cells = []
        for style in classes:
            cell = value_cell(own[style], scale=1.0 if "V" in style else 100)
            cells.append(Cell(cell.text, f"{cell.note} n = {own[style]['n_drivers']}".strip(), cell.look))
        rows.append((Cell(corpus, look="head"), *cells))
    silent = without((c for c in corpora_of(table) if c not in corpora_of(said)), why="too few drivers to cluster")
    heads = tuple(style if "V" in style else f"{style} (%)" for style in classes)
    title = f"KDSC aggressive among the drivers of each TDBM class; V is of all who have a class.{silent}"
    return Table(title, ("corpus", *heads), tuple(rows))


def sensitivity_table(table: Frame) -> Table:
    """κ with the default when the same drivers are measured or scaled otherwise; below it what changes."""
    said = known(table, "same_class")
    variants = list(dict.fromkeys(table["variant"].to_list()))
    rows = []
    for corpus in corpora_of(said):
        own = {row["variant"]: row for row in where(table, corpus=corpus).iter_rows(named=True)}
        first = where(said, corpus=corpus).row(0, named=True)
        who = f"{first['scenes']} of {first['of_scenes']} scenes"
        rows.append((Cell(corpus, who, "head"), *(_variant(own.get(variant)) for variant in variants)))
    silent = without(c for c in corpora_of(table) if c not in corpora_of(said))
    title = (
        "The same drivers, measured or scaled otherwise: κ with the default; share with the same class; mean change of "
        f"a; largest change of a class’ share.{silent}"
    )
    return Table(title, ("corpus", *variants), tuple(rows))


def _variant(row: Row | None) -> Cell:
    if row is None:
        return Cell(EM, look="refused")
    if row["same_class"] is None:
        return Cell(row["status"], look="refused")
    kappa = EM if row["kappa"] is None else number(row["kappa"], 2)
    note = f"{100 * row['same_class']:.0f} % same; |Δa| {row['a_change']:.2f}; {100 * row['largest_shift']:.0f} points"
    return Cell(kappa, note)


def counts_table(about: dict[str, Any]) -> Table:
    """Who was counted, a row per corpus."""
    heads = tuple(next(iter(about.values()))["counts"])
    rows = tuple(
        (Cell(name, look="head"), *(Cell(str(one["counts"][head]), look="number") for head in heads))
        for name, one in about.items()
    )
    return Table("Who was counted", ("corpus", *heads), rows)
