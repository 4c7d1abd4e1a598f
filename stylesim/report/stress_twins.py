"""The sections of the stress report on counterfactual twins, and on what a forecast costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from stylesim.evaluation.latency import AGENTS, Latency
from stylesim.evaluation.stress_results import Stress
from stylesim.evaluation.stress_twins import MIXTURE
from stylesim.evaluation.twin_pairs import NULL, TWIN
from stylesim.evaluation.twin_shift import FIGURES
from stylesim.report.blocks import Block, Section
from stylesim.report.tables import Cell, Table, estimate_cell, grouped, number, size_text

SWITCHED = (
    "One past, two futures: at t0 the driver becomes another person. The histories are the same to the last bit, "
    "so a forecaster that is not told the style must say the same. Covered: a mode ends within 2 m."
)
MIXED = (
    "Do probabilities match the mixture? The energy score (m, proper, less is better) of the forecast for both futures "
    "alike; what it exceeds the same modes with equal probabilities by (below 0: the probabilities inform), and with "
    "the best probabilities for that mixture (0: they match it). The null twin keeps its style and has other luck: "
    "what is not more than there is chance."
)
STARTED = (
    "Twins from the start have another style all along, so the history shows it. Compared are displacements from the "
    "driver's own place at t0: how far both worlds part, how far both forecasts do, whether they part the same way, "
    "and how much of the true difference the forecast makes (1: all); last, of what constant velocity leaves of it. "
    "Differences under 1 m have no direction. The null twin has the same style and other luck."
)
PAIRS = {TWIN: "another style", NULL: "same style, other luck (null)"}


def twins_section(found: Sequence[Stress]) -> list[Section]:
    """What of both kinds of twins there is; no section without twins."""
    blocks, texts = [], []
    if any(one.twins is not None and one.twins.drivers for one in found):
        texts += [SWITCHED, MIXED]
        blocks += [Block(table=_switched(found)), Block(table=_mixture(found))]
    if any(one.shift is not None for one in found):
        texts.append(STARTED)
        blocks.append(Block(table=_shift(found)))
    return [Section("twins", "Counterfactual twins", tuple(texts), tuple(blocks))] if blocks else []


def _switched(found: Sequence[Stress]) -> Table:
    names = ("covers_own", "covers_twin", "covers_both", "apart_m")
    rows = tuple(
        (
            Cell(one.forecaster, size_text(one.twins.figures["apart_m"]), "head"),
            Cell(f"{one.twins.identical} of {one.twins.drivers}", look="number"),
            *(estimate_cell(one.twins.figures[name]) for name in names),
        )
        for one in found
        if one.twins is not None
    )
    heads = ("forecaster", "same forecast", "own future covered", "twin's covered", "both covered", "ends apart (m)")
    return Table("Drivers whose style was switched at t0", heads, rows)


def _mixture(found: Sequence[Stress]) -> Table:
    rows = tuple(
        (
            Cell(one.forecaster, look="head"), Cell(PAIRS[pair], size_text(figures["score_m"])),
            *(estimate_cell(figures[name], judge=name == "over_equal_m") for name in MIXTURE),
        )
        for one in found
        if one.twins is not None
        for pair, figures in one.twins.mixture.items()
    )  # fmt: skip
    heads = ("forecaster", "the other future", "energy score (m)", "above equal ones (m)", "above the best (m)")
    return Table("Probabilities of the modes against the mixture of two futures", heads, grouped(rows))


def _shift(found: Sequence[Stress]) -> Table:
    rows = tuple(
        (
            Cell(one.forecaster, look="head"), Cell(PAIRS[pair], size_text(figures["true_m"])),
            *(estimate_cell(figures[name]) for name in FIGURES),
        )
        for one in found
        if one.shift is not None
        for pair, figures in one.shift.figures.items()
    )  # fmt: skip
    heads = (
        "forecaster", "the other world", "worlds part (m)", "forecasts part (m)", "the same way",
        "share of it", "beyond constant velocity",
    )  # fmt: skip
    return Table("Drivers who are another person from the start", heads, grouped(rows))


def latency_section(latencies: Mapping[str, Latency]) -> list[Section]:
    """CPU and wall time per scene; no section where it was not measured."""
    if not latencies:
        return []
    rows = tuple(
        (
            Cell(name, f"{one.scenes} scenes of {one.drivers:.0f} drivers", "head"),
            *(Cell(number(value, 2), look="number") for value in (one.cpu_median_ms, one.cpu_p95_ms)),
            *(Cell(number(value, 2), look="number") for value in (one.wall_median_ms, one.wall_p95_ms)),
        )
        for name, one in latencies.items()
    )
    heads = ("forecaster", "CPU, median (ms)", "CPU, 95 % (ms)", "wall, median (ms)", "wall, 95 % (ms)")
    machine = next(iter(latencies.values())).machine
    text = (
        f"One scene at a time, {AGENTS} drivers at most, after a warm-up, on {machine}. These figures are of that "
        "machine and moment; they are in latency.json and in no other file."
    )
    return [Section("latency", "What a forecast costs", (text,), (Block(table=Table("Per scene", heads, rows)),))]
