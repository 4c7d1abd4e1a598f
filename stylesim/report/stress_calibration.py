"""The section of the stress report on what a forecaster knows of its own error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from stylesim.evaluation.strata import title_of
from stylesim.evaluation.stress_results import Coverage, Stress
from stylesim.report.blocks import Block, Section, picture
from stylesim.report.figures import WIDTH
from stylesim.report.tables import EM, Cell, Table, estimate_cell, grouped, number, size_text
from stylesim.report.theme import SERIES_COLOUR, SERIES_MARKER, drawing, new_figure

RELIABLE = (
    "Each mode claims, with its probability, to be the one that ends nearest to the truth. Shown is how often claims "
    "of about that probability came true; on the diagonal they mean what they say. ECE is the mean distance to it. A "
    "forecaster of one mode has nothing to calibrate."
)
CONFORMAL = (
    "Discs about the modes that hold 90 % of the final positions of the drivers they were calibrated on (half of the "
    "episodes), and the share that they hold of others, by commanded style. Where everyday discs meet rare drivers, "
    "less than 90 % is what a promise made on everyday traffic is worth."
)


def calibration_section(found: Sequence[Stress]) -> Section:
    """Reliability of mode probabilities, and conformal regions."""
    blocks = picture(reliability_figure(found), "Bins with less than 0.1 % of the claims are not drawn.")
    rows = []
    for one in found:
        rows += [
            (Cell(one.forecaster, look="head"), Cell(each.group, size_text(each.error)),
             estimate_cell(each.error, digits=3))
            for each in one.reliability
        ] or [(Cell(one.forecaster, look="head"), Cell("all"), Cell(EM, "one mode", "refused"))]  # fmt: skip
    table = Table("Expected calibration error of mode probabilities", ("forecaster", "drivers", "ECE"), grouped(rows))
    blocks.append(Block(table=table))
    # Open: everyday discs held against rare drivers; where there is one population only, its own.
    crossed = any(each.calibrated_on != each.judged_on for one in found for each in one.coverage)
    blocks += [
        Block(
            table=_coverage_table(one.forecaster, each),
            fold=each.by != "commanded" or (crossed and each.calibrated_on == each.judged_on),
        )
        for one in found
        for each in one.coverage
    ]
    return Section("calibration", "Does it know?", (RELIABLE, CONFORMAL), tuple(blocks))


def _coverage_table(name: str, coverage: Coverage) -> Table:
    rows = tuple(
        (
            Cell(one.group, size_text(one.pooled_coverage), "head"),
            Cell(number(one.radius_m, 2) if np.isfinite(one.radius_m) else EM, "", "number"),
            estimate_cell(one.coverage), estimate_cell(one.pooled_coverage),
        )
        for one in coverage.regions
    )  # fmt: skip
    caption = (
        f"{name}, by {title_of(coverage.by)}: calibrated on {coverage.calibrated_on}, judged on {coverage.judged_on}; "
        f"one radius for all is {coverage.pooled_radius_m:.2f} m"
    )
    return Table(caption, (title_of(coverage.by), "own radius (m)", "coverage", "coverage, one radius for all"), rows)


def reliability_figure(found: Sequence[Stress]) -> Figure | None:
    """Claimed against came true, one line per forecaster; None where all have one mode."""
    several = [(i, one.forecaster, one.reliability[0]) for i, one in enumerate(found) if one.reliability]
    if not several:
        return None
    with drawing():
        figure, (axes,) = new_figure(WIDTH * 0.6, 4.2)
        axes.plot([0, 1], [0, 1], color="#8A949E", lw=1, ls="--")
        for i, name, each in several:
            shown = each.weight > 0.001
            colour, marker = SERIES_COLOUR[i % len(SERIES_COLOUR)], SERIES_MARKER[i % len(SERIES_MARKER)]
            axes.plot(each.claimed[shown], each.came_true[shown], lw=1.4, label=name, color=colour, marker=marker)
        axes.set_xlabel("probability of the mode")
        axes.set_ylabel("how often it ended nearest")
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1)
        axes.set_title("Reliability of mode probabilities, all drivers")
        axes.legend(loc="upper left")
    return figure
