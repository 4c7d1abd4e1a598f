"""The page of `stylesim stress`: for whom a forecaster is wrong, whether it knows, and when rare drivers come."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from stylesim.corpus.files import json_bytes, write_whole
from stylesim.errors import InputError
from stylesim.evaluation.latency import Latency
from stylesim.evaluation.metrics import METRICS
from stylesim.evaluation.results import HEADINGS
from stylesim.evaluation.stress_results import Stress
from stylesim.report.blocks import Block, Section
from stylesim.report.evaluate import file_names
from stylesim.report.html import render
from stylesim.report.sections import errors_section, warnings
from stylesim.report.stress_calibration import calibration_section
from stylesim.report.stress_decisions import criticality_section, decisions_section
from stylesim.report.stress_twins import latency_section, twins_section
from stylesim.report.tables import Cell, Table, estimate_cell, facts_table, grouped, number, size_text
from stylesim.report.theme import plural

LATENCY_FILE = "latency.json"
DEGRADED = (
    "The same scenarios, seeds and events, driven by the everyday population and by one in which rare styles are "
    "common: rare_heavy minus naturalistic, above 0 is worse. Over all: every scenario weighs the same."
)
EVENTS = (
    "Windows in which an event happens to the driver, and windows of who caused one (which are in no other table). The "
    "error of who caused an event tells how surprising the event was."
)


def save_stress(found: Sequence[Stress], page: str | Path, *, latencies: Mapping[str, Latency] | None = None) -> Path:
    """Write the page (.html) and beside it each forecaster's .stress.json and evaluation; returns the page.

    `latencies`, by forecaster, go into the page and into latency.json: they are of this machine and moment.
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
    if latencies:
        times = {name: one.to_dict() for name, one in latencies.items()}
        write_whole(path.parent / LATENCY_FILE, json_bytes(times))
    about = found[0].evaluation.about
    sections = [
        errors_section(evaluations, seed=int(about["intervals"]["seed"])),
        _worst_section(found), _events_section(found), *criticality_section(found), *decisions_section(found),
        calibration_section(found), *twins_section(found), *latency_section(latencies or {}), *_extra(found),
    ]  # fmt: skip
    lead = (
        f"{plural(len(found), 'forecaster')}; {about['corpus']['scenes']} scenes of {about['corpus']['name']}; "
        f"{about['history_s']:g} s of history, {about['future_s']:g} s ahead. Made with stylesim "
        f"{about['versions']['stylesim']}."
    )
    html = render("Forecasts under stress", lead, sections, warnings(evaluations), [finding(one) for one in found])
    write_whole(path, html.encode())
    return path


def _extra(found: Sequence[Stress]) -> list[Section]:
    first = found[0].evaluation.counts
    alike = all(one.evaluation.counts == first for one in found)  # as it is with questions that all can answer
    asked = {"Of every forecaster": first} if alike else {one.forecaster: one.evaluation.counts for one in found}
    counts = [Block(table=facts_table(name, facts)) for name, facts in asked.items()]
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
    return Table("rare_heavy minus naturalistic, with 95 % intervals", heads, grouped(rows))


def _events_section(found: Sequence[Stress]) -> Section:
    values = dict.fromkeys(item.value for one in found for item in one.events)
    rows = [
        (
            Cell(item.value, size_text(item.size), "head"), Cell(one.forecaster),
            *(estimate_cell(item.metrics[metric]) for metric in METRICS),
        )
        for value in values
        for one in found
        for item in one.events
        if item.value == value
    ]  # fmt: skip
    heads = ("event", "forecaster", *(HEADINGS[metric] for metric in METRICS))
    table = Table("By event: mean over drivers, 95 % interval below", heads, grouped(rows))
    return Section("events", "When something happens", (EVENTS,), (Block(table=table),))
