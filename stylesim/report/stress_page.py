"""The page of `stylesim stress`: for whom a forecaster is wrong, whether it knows, and when rare drivers come."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.evaluation.metrics import METRICS
from stylesim.evaluation.results import HEADINGS
from stylesim.evaluation.stress import Coverage, Stress
from stylesim.report.blocks import Block, Section, picture
from stylesim.report.evaluate import file_names
from stylesim.report.figures import WIDTH
from stylesim.report.html import render
from stylesim.report.sections import errors_section, warnings
from stylesim.report.tables import EM, Cell, Table, estimate_cell, facts_table, number, size_text
from stylesim.report.theme import SERIES_COLOUR, SERIES_MARKER, drawing, new_figure, plural

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
DEGRADED = (
    "The same scenarios, seeds and events, driven by the everyday population and by one in which rare styles are "
    "common: rare_heavy minus naturalistic, above 0 is worse. Over all: every scenario weighs the same."
)
EVENTS = (
    "Windows in which an event happens to the driver, and windows of who caused one (which are in no other table). The "
    "error of who caused an event tells how surprising the event was."
)


def save_stress(found: Sequence[Stress], page: str | Path) -> Path:
    """Write the page (.html) and beside it each forecaster's .stress.json and evaluation; returns the page.

    InputError for another ending, or without a forecaster.
    """
    path = Path(page)
    if path.suffix != ".html":
        raise InputError(f"{path}: a report is an .html file")
    if not found:
        raise InputError("there is no forecaster to report")
    evaluations = [one.evaluation for one in found]
    for one, name in zip(found, file_names(evaluations), strict=True):
        one.save(path.parent / name)
    about = found[0].evaluation.about
    sections = [
        errors_section(evaluations, seed=int(about["intervals"]["seed"])),
        _worst_section(found), _events_section(found), _calibration_section(found),
        *_twins_section(found), *_extra(found),
    ]  # fmt: skip
    lead = (
        f"{plural(len(found), 'forecaster')}; {about['corpus']['scenes']} scenes of {about['corpus']['name']}; "
        f"{about['history_s']:g} s of history, {about['future_s']:g} s ahead. Made with stylesim "
        f"{about['versions']['stylesim']}."
    )
    html = render("Forecasts under stress", lead, sections, warnings(evaluations), [finding(one) for one in found])
    write_whole(path, html.encode())
    return path


def _twins_section(found: Sequence[Stress]) -> list[Section]:
    """One row per forecaster; no section without twins."""
    rows = []
    for one in found:
        if one.twins is not None:
            same = Cell(f"{one.twins.identical} of {one.twins.drivers}", look="number")
            names = ("covers_own", "covers_twin", "covers_both", "apart_m")
            rows.append(
                (Cell(one.forecaster, look="head"), same, *(estimate_cell(one.twins.figures[n]) for n in names))
            )
    if not rows:
        return []
    heads = ("forecaster", "same forecast", "own future covered", "twin's covered", "both covered", "ends apart (m)")
    table = Table("Drivers whose style was switched at t0", heads, tuple(rows))
    text = (
        "One past, two futures: at t0 the driver becomes another person. The histories are the same to the last bit, "
        "so a forecaster that is not told the style must say the same. Covered: a mode ends within 2 m."
    )
    return [Section("twins", "Counterfactual twins", (text,), (Block(table=table),))]


def _extra(found: Sequence[Stress]) -> list[Section]:
    counts = [Block(table=facts_table(f"{one.forecaster}: what was asked", one.evaluation.counts)) for one in found]
    raw = json.dumps(dict(found[0].evaluation.about), indent=1, sort_keys=True)
    return [Section("asked", "What was asked", (), (*counts, Block(caption="About", raw=raw)))]


def finding(one: Stress) -> str:
    """One sentence: the overall error, the worst group, and what rare drivers cost."""
    whole = one.evaluation.overall.metrics["min_fde_m"]
    if whole.refused:
        return f"{one.forecaster}: too few drivers to say anything."
    parts = [f"{one.forecaster}: minFDE {whole.value:.2f} m [{whole.low:.2f}, {whole.high:.2f}]"]
    if one.worst is not None:
        gap = one.worst.gap_m
        parts.append(
            f"worst {one.worst.value} (of {one.worst.among} groups), {gap.value:+.2f} m [{gap.low:.2f}, {gap.high:.2f}]"
        )
    if one.degradation and not one.degradation[0].change["min_fde_m"].refused:
        change = one.degradation[0].change["min_fde_m"]
        parts.append(f"with rare drivers {change.value:+.2f} m [{change.low:.2f}, {change.high:.2f}]")
    return "; ".join(parts) + "."


def _worst_section(found: Sequence[Stress]) -> Section:
    rows = []
    for one in found:
        worst = one.worst
        if worst is None:
            rows.append((Cell(one.forecaster, look="head"), *[Cell("too few", look="refused")] * 4))
            continue
        rows.append((
            Cell(one.forecaster, look="head"), Cell(worst.value, size_text(worst.error_m)),
            estimate_cell(worst.error_m), estimate_cell(worst.gap_m), Cell(f"{worst.ratio:.2f} ×", look="number"),
        ))  # fmt: skip
    heads = ("forecaster", "worst group", "minFDE (m)", "above the average (m)", "of the average")
    caption = "The worst style × scenario. It was chosen on these drivers: its distance is rather too large."
    blocks = [Block(table=Table(caption, heads, tuple(rows)))]
    if any(one.degradation for one in found):
        blocks.append(Block("From everyday to rare drivers", table=_degradation_table(found)))
    return Section("worst", "Worst group, and rare drivers", (DEGRADED,), tuple(blocks))


def _degradation_table(found: Sequence[Stress]) -> Table:
    rows = []
    for one in found:
        for change in one.degradation:
            size = change.change[METRICS[0]]
            before, after = change.everyday["min_fde_m"], change.rare["min_fde_m"]
            rows.append((
                Cell(one.forecaster, look="head"), Cell(change.scenario, size_text(size)),
                Cell(f"{number(before, 2)} → {number(after, 2)}", look="number"),
                *(estimate_cell(change.change[metric], judge=True) for metric in METRICS),
            ))  # fmt: skip
    heads = ("forecaster", "scenario", "minFDE (m)", *(f"Δ {HEADINGS[metric]}" for metric in METRICS))
    return Table("rare_heavy minus naturalistic, with 95 % intervals", heads, tuple(rows))


def _events_section(found: Sequence[Stress]) -> Section:
    rows = [
        (
            Cell(item.value, size_text(item.size), "head"), Cell(one.forecaster),
            *(estimate_cell(item.metrics[metric]) for metric in METRICS),
        )
        for one in found
        for item in one.events
    ]  # fmt: skip
    heads = ("event", "forecaster", *(HEADINGS[metric] for metric in METRICS))
    table = Table("By event: mean over drivers, 95 % interval below", heads, tuple(rows))
    return Section("events", "When something happens", (EVENTS,), (Block(table=table),))


def _calibration_section(found: Sequence[Stress]) -> Section:
    blocks = picture(reliability_figure(found), "Bins with less than 0.1 % of the claims are not drawn.")
    rows = []
    for one in found:
        rows += [
            (Cell(one.forecaster, look="head"), Cell(each.group, size_text(each.error)),
             estimate_cell(each.error, digits=3))
            for each in one.reliability
        ] or [(Cell(one.forecaster, look="head"), Cell("all"), Cell(EM, "one mode", "refused"))]  # fmt: skip
    table = Table("Expected calibration error of mode probabilities", ("forecaster", "drivers", "ECE"), tuple(rows))
    blocks.append(Block(table=table))
    blocks += [Block(table=_coverage_table(one.forecaster, each)) for one in found for each in one.coverage]
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
        f"{name}: calibrated on {coverage.calibrated_on}, judged on {coverage.judged_on}; "
        f"one radius for all is {coverage.pooled_radius_m:.2f} m"
    )
    return Table(caption, ("style", "own radius (m)", "coverage", "coverage, one radius for all"), rows)


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
