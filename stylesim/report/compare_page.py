"""The page of `stylesim compare`: paired differences of two forecasters, and what stands beside each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.evaluation.comparison import Comparison
from stylesim.evaluation.metrics import METRICS
from stylesim.evaluation.results import HEADINGS
from stylesim.evaluation.slices import ALL
from stylesim.evaluation.strata import title_of
from stylesim.evaluation.stress_decisions import MEASURES
from stylesim.report.blocks import Block, Section, picture
from stylesim.report.figures import MOST_CELLS, WIDTH
from stylesim.report.html import render
from stylesim.report.sections import DEFINITIONS
from stylesim.report.stress_decisions import HEADS, TITLES
from stylesim.report.tables import Cell, Table, estimate_cell, grouped, number, size_text
from stylesim.report.theme import SERIES_COLOUR, drawing, new_figure

PAIRED = "Mean over drivers of the difference on the same windows; ▼ and ▲ mark 95 % intervals that exclude 0."
METRIC = "min_fde_m"


def finding(found: Comparison) -> str:
    """One sentence: the overall difference, and in how many cells of the last stratum either one is better."""
    whole = found.cells[ALL][ALL][METRIC]
    names = f"{found.ours.forecaster} minus {found.theirs.forecaster}"
    if whole.refused:
        return f"{names}: too few drivers to say anything."
    text = f"{names}: minFDE {number(whole.value, 2)} m [{number(whole.low, 2)}, {number(whole.high, 2)}]"
    by = list(found.cells)[-1]
    shown = [metrics[METRIC] for metrics in found.cells[by].values() if not metrics[METRIC].refused]
    if by == ALL or not shown:
        return f"{text}."
    better, worse = sum(one.high < 0 for one in shown), sum(one.low > 0 for one in shown)
    return f"{text}; by {title_of(by)} better in {better}, worse in {worse} of {len(shown)} cells that may be shown."


def save_comparison(found: Comparison, page: str | Path) -> Path:
    """Write the page, whole or not at all; InputError unless it ends in .html."""
    path = Path(page)
    if path.suffix != ".html":
        raise InputError(f"{path}: a report is an .html file")
    about = found.ours.about
    lead = (
        f"{about['corpus']['scenes']} scenes of {about['corpus']['name']}; {about['history_s']:g} s of history, "
        f"{about['future_s']:g} s ahead. Made with stylesim {about['versions']['stylesim']}."
    )
    sections = [_errors(found), *_decided(found), *_beside(found)]
    title = f"{found.ours.forecaster} against {found.theirs.forecaster}"
    write_whole(path, render(title, lead, sections, [], [finding(found)]).encode())
    return path


def _errors(found: Comparison) -> Section:
    blocks: list[Block] = []
    for by, cells in found.cells.items():
        if by != ALL:
            caption = "Points are paired differences, bars 95 % intervals; left of the line the first one is better."
            blocks += picture(difference_figure(found, by), caption, heading=f"By {title_of(by)}")
        rows = tuple(
            (
                Cell(value.replace(ALL, "all drivers"), size_text(metrics[METRICS[0]]), "head"),
                *(estimate_cell(metrics[metric], judge=True, digits=3) for metric in METRICS),
            )
            for value, metrics in cells.items()
        )
        heads = ("" if by == ALL else title_of(by), *(f"Δ {HEADINGS[metric]}" for metric in METRICS))
        blocks.append(Block(table=Table("Below 0 the first one is better", heads, rows)))
    return Section("errors", "Forecast errors", (PAIRED, DEFINITIONS), tuple(blocks))


def difference_figure(found: Comparison, by: str) -> Figure | None:
    """Differences in minFDE per value of `by`; None where nothing may be drawn."""
    cells = {value: metrics[METRIC] for value, metrics in found.cells[by].items()}
    if len(cells) > MOST_CELLS or all(one.refused for one in cells.values()):
        return None
    with drawing():
        figure, (axes,) = new_figure(WIDTH, 1.2 + 0.34 * len(cells))
        for place, one in enumerate(cells.values()):
            if not one.refused:
                within = one.status == "within site"
                axes.plot(
                    [one.low, one.high], [place, place], color=SERIES_COLOUR[0], lw=1.6, ls=":" if within else "-"
                )
                face = "white" if within else SERIES_COLOUR[0]
                axes.plot(one.value, place, "o", color=SERIES_COLOUR[0], mfc=face, ms=6)
            else:
                axes.annotate(
                    "too few", (0.01, place), xycoords=("axes fraction", "data"), va="center", color="#6B7680"
                )
        axes.axvline(0.0, color="#8A949E", lw=1, ls="--")
        axes.set_yticks(
            np.arange(len(cells)), [f"{value}\nn = {one.n_drivers}" for value, one in cells.items()], fontsize=8
        )
        axes.set_ylim(len(cells) - 0.4, -0.6)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel(f"Δ {HEADINGS[METRIC]}")
        axes.set_title(f"{found.ours.forecaster} minus {found.theirs.forecaster}, by {title_of(by)}")
    return figure


def _decided(found: Comparison) -> list[Section]:
    blocks = []
    for (kind, by), cells in found.decisions.items():
        if by != ALL and len(cells) < 2:
            continue
        title = "" if by == ALL else TITLES.get(by, by)
        rows = tuple(
            (
                Cell(value.replace(ALL, "all drivers"), size_text(measures[MEASURES[0]]), "head"),
                *(estimate_cell(measures[name], judge=name == "brier") for name in MEASURES),
            )
            for value, measures in cells.items()
        )
        what = f"{kind[0].upper()}{kind[1:]}" + (f", by {title}" if title else "")
        caption = f"{what}: above 0 the first one is better, but for the Brier score"
        table = Table(caption, (title, *(f"Δ {HEADS[name]}" for name in MEASURES)), rows)
        blocks.append(Block(table=table, fold=by not in (ALL, "taken")))
    return [Section("decisions", "The decision that mattered", (PAIRED,), tuple(blocks))] if blocks else []


def _beside(found: Comparison) -> list[Section]:
    if not found.figures:
        return []
    rows = tuple(
        (
            Cell(one.group, look="head"), Cell(one.name),
            *(estimate_cell(side, digits=3) for side in (one.ours, one.theirs)), Cell(one.better),
        )
        for one in found.figures
    )  # fmt: skip
    heads = ("", "figure", found.ours.forecaster, found.theirs.forecaster, "better")
    text = "These are not paired: each has its own interval, and overlapping intervals prove nothing."
    return [
        Section(
            "beside",
            "Beside each other",
            (text,),
            (Block(table=Table("Both on the same traffic", heads, grouped(rows))),),
        )
    ]
