"""The sections of the stress report on decisions that a future turns on, and on how critical it was."""

from __future__ import annotations

from collections.abc import Sequence

from stylesim.evaluation.decisions import FIRST_OR_SECOND, STOP_OR_GO
from stylesim.evaluation.metrics import METRICS
from stylesim.evaluation.results import HEADINGS
from stylesim.evaluation.slices import ALL
from stylesim.evaluation.stress_decisions import CUTS, KINDS, MEASURES, DecisionCell
from stylesim.evaluation.stress_results import Stress
from stylesim.report.blocks import Block, Section
from stylesim.report.tables import EM, Cell, Table, estimate_cell, grouped, number, size_text

DECIDED = (
    "Asked at the moment of the decision. Held: one of the modes does what the driver did (the rest is the miss of the "
    "decision). Probability: of all modes that do it. Brier: (1 − that probability)², to be held against guessing, one "
    "probability for everybody. Who caused an event is left out."
)
WHAT = {
    STOP_OR_GO: "At the first frame of yellow, 1.6 to 5.5 s from the line with nobody stopping ahead: over the line "
    "within the future, or not.",
    FIRST_OR_SECOND: "Two whose ways come together (a merge, a ring, a crossing, a change of lane), at the first "
    "moment at which either could have been first: at the place before the other, or not.",
}
TITLES = {"taken": "what was done", "commanded": "commanded style", "with an event": "event"}
HEADS = {"covered": "held", "mass": "probability", "top_right": "most probable mode right", "brier": "Brier"}
CRITICAL = (
    "By what the driver meets in the future that is to be forecast: its least time to collision with the leader, and "
    "the hardest braking that it needs to avoid one. The limits are those of stylesim criticality."
)


def decisions_section(found: Sequence[Stress]) -> list[Section]:
    """A table per kind for all drivers and by what was done; by scenario, style and event folded; none without any."""
    blocks = []
    for kind in KINDS:
        for by in CUTS:
            cells = [
                (one.forecaster, [c for c in one.decisions.cells if (c.kind, c.by) == (kind, by)]) for one in found
            ]
            if by == ALL:
                pairs = [(name, c) for name, own in cells for c in own]
                if not pairs:
                    break
                blocks.append(Block(f"{kind[0].upper()}{kind[1:]}", table=_decision_table(WHAT[kind], "", pairs)))
                continue
            values = list(dict.fromkeys(c.value for _, own in cells for c in own))
            if len(values) > 1:
                pairs = [(name, c) for value in values for name, own in cells for c in own if c.value == value]
                title = TITLES.get(by, by)
                blocks.append(
                    Block(
                        table=_decision_table(f"{kind[0].upper()}{kind[1:]}, by {title}", title, pairs),
                        fold=by != "taken",
                    )
                )
    return [Section("decisions", "The decision that mattered", (DECIDED,), tuple(blocks))] if blocks else []


def _decision_table(caption: str, title: str, pairs: Sequence[tuple[str, DecisionCell]]) -> Table:
    rows = []
    for name, cell in pairs:
        size = cell.measures[MEASURES[0]]
        lead = (
            (Cell(name, size_text(size), "head"),)
            if not title
            else (Cell(cell.value, size_text(size), "head"), Cell(name))
        )
        rows.append((*lead, *(estimate_cell(cell.measures[m]) for m in MEASURES), Cell(_guess(cell), look="number")))
    heads = (*((title,) if title else ()), "forecaster", *(HEADS[m] for m in MEASURES), "Brier of guessing")
    return Table(caption, heads, grouped(rows))


def _guess(cell: DecisionCell) -> str:
    return EM if cell.measures["brier"].refused else number(cell.guessing, 2)


def criticality_section(found: Sequence[Stress]) -> list[Section]:
    """Errors by least time to collision and by braking needed."""
    blocks = []
    for by in dict.fromkeys(item.by for one in found for item in one.criticality):
        rows = []
        values = dict.fromkeys(item.value for one in found for item in one.criticality if item.by == by)
        for value in values:
            for one in found:
                for item in one.criticality:
                    if (item.by, item.value) == (by, value):
                        lead = (Cell(value, size_text(item.size), "head"), Cell(one.forecaster))
                        rows.append((*lead, *(estimate_cell(item.metrics[metric]) for metric in METRICS)))
        heads = (by, "forecaster", *(HEADINGS[metric] for metric in METRICS))
        caption = f"By {by} in the future: mean over drivers, 95 % interval below"
        blocks.append(Block(table=Table(caption, heads, grouped(rows))))
    return [Section("criticality", "When it is close", (CRITICAL,), tuple(blocks))] if blocks else []
