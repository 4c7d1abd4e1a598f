"""The page of `stylesim fidelity`: one self-contained HTML file."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.evaluation.fidelity_agreement import TITLES, Agreement
from stylesim.evaluation.fidelity_results import EVERYONE, Fidelity
from stylesim.evaluation.fidelity_targets import CLASSES, EXCLUDED_AT_MOST, targets_of, verdict
from stylesim.evaluation.label_summary import RANK_CEILING
from stylesim.report.blocks import Block, Section, picture
from stylesim.report.fidelity_figures import knob_figure, matrix_figure, ranges_figure
from stylesim.report.html import render
from stylesim.report.tables import Cell, Table, estimate_cell, facts_table
from stylesim.report.theme import plural
from stylesim.style import STYLE_CLASSES

METHOD_TITLES = {"tdbm": "TDBM, printed orientation", "tdbm_transposed": "TDBM, transposed", "kdsc": "KDSC"}
SPAN_TITLES = {"track": "whole trips", "window": "11 s windows"}
HOW = (
    "A driver was commanded a style when he was drawn, and is measured from his logged track alone, by scalers that "
    "were frozen before and never saw this corpus. Every driver logged for 20 s is judged. Whole trips: the features "
    "of a driver's 11 s windows averaged, then judged; windows: each judged by itself, a driver counting once. "
    "Intervals resample episodes, then drivers."
)
CEILING = (
    "TDBM's classes are not in the order of the measured aggressiveness a: even where every driver measures exactly "
    f"as commanded, the rank correlation of class and a only reaches the ceiling ({RANK_CEILING[0]} to "
    f"{RANK_CEILING[1]} over five candidate scalars on evenly spread features)."
)


def save_fidelity(found: Fidelity, path: str | Path) -> Path:
    """Write the page (.html) whole or not at all, and return its path. InputError for another ending."""
    page = Path(path)
    if page.suffix != ".html":
        raise InputError(f"{page}: a report is an .html file")
    sections = [_agreement_section(found), _kdsc_section(found), _features_section(found), _robust_section(found),
                _excluded_section(found), _provenance_section(found)]  # fmt: skip
    about = found.about["corpus"]
    lead = f"Corpus {about['name']}, seed {about['seed']}; {plural(len(found.knob), 'driver')} judged."
    shown = [one for one in sections if one is not None]
    write_whole(
        page, render("Do drivers drive as commanded?", lead, shown, _warnings(found), _findings(found)).encode()
    )
    return page


def _findings(found: Fidelity) -> list[str]:
    listed = []
    for one in found.of():
        if one.estimates and not one.estimates["kappa"].refused:
            value = one.estimates["balanced_accuracy"]
            said = f"; targets {verdict(one)}" if verdict(one) else ""
            listed.append(
                f"{one.group}: balanced accuracy {value.value:.2f} [{value.low:.2f}, {value.high:.2f}] over "
                f"{plural(one.n_drivers, 'driver')} of {plural(one.n_units, 'episode')}{said}."
            )
    return listed


def _warnings(found: Fidelity) -> list[str]:
    lost = [s for s in STYLE_CLASSES if found.share_excluded(s) > EXCLUDED_AT_MOST]
    return [f"More than {100 * EXCLUDED_AT_MOST:g} % of these styles could not be judged: {', '.join(lost)}."] * bool(
        lost
    )


def _agreement_section(found: Fidelity) -> Section:
    blocks: list[Block] = []
    references = list(dict.fromkeys(one.reference for one in found.agreements))
    for reference in references:
        whole = [found.of(reference=reference, span=span)[0] for span in SPAN_TITLES]
        caption = f"{EVERYONE}, {METHOD_TITLES['tdbm']}, judged by {reference}; % of each commanded class."
        blocks += picture(matrix_figure(whole, list(SPAN_TITLES.values())), caption, heading=f"Judged by {reference}")
        if reference == references[0]:
            caption = (
                "Marks are drivers, at most a few thousand of them; shaded: the stretch of the knob that a class owns."
            )
            blocks += picture(knob_figure(found), caption, raster=True)
        for method in ("tdbm", "tdbm_transposed"):
            for span in SPAN_TITLES:
                table = _agreement_table(found.of(method=method, reference=reference, span=span), span, method)
                blocks.append(Block(table=table, fold=method != "tdbm" or reference != references[0]))
        turned = found.of(method="tdbm_transposed", reference=reference)[0]
        blocks += picture(matrix_figure([turned], ["whole trips, transposed"]), f"{EVERYONE}, judged by {reference}.")
    return Section("agreement", "Commanded against measured", (HOW, CEILING), tuple(blocks))


def _agreement_table(listed: Sequence[Agreement], span: str, method: str) -> Table:
    rows = []
    for one in listed:
        wanted = targets_of(one.group) if (method, span) == ("tdbm", "track") else {}
        size = Cell(str(one.n_drivers), f"{plural(one.n_units, 'episode')}, least class {min(one.per_class)}", "number")
        present = Cell(f"{one.classes_present} of {CLASSES}", look="number")
        cells = [_judged(one, name, wanted.get(name)) for name in TITLES]
        rows.append((Cell(one.group, look="head"), size, present, *cells))
    caption = f"{METHOD_TITLES[method]}, {SPAN_TITLES[span]}. ▲ a target is missed, ▼ reached."
    return Table(caption, ("group", "drivers", "classes measured", *TITLES.values()), tuple(rows))


def _judged(one: Agreement, name: str, target: float | None) -> Cell:
    value = one.estimates.get(name)
    cell = estimate_cell(value)
    if target is None or value is None or value.refused:
        return cell
    look = "better" if value.value >= target else "worse"
    return Cell(cell.text, f"{cell.note}, target {target:.2f}", look)


def _kdsc_section(found: Fidelity) -> Section | None:
    blocks = []
    for reference in dict.fromkeys(one.reference for one in found.agreements):
        for span, title in SPAN_TITLES.items():
            listed = found.of(method="kdsc", reference=reference, span=span)
            if not listed:
                continue
            name = listed[0].measured[0]
            rows = tuple(
                (Cell(one.group, f"n = {one.n_drivers}", "head"),
                 *(estimate_cell(one.estimates.get(f"{name}|{style}")) for style in STYLE_CLASSES))
                for one in listed
            )  # fmt: skip
            caption = f"Share of each commanded class that KDSC ({reference}) calls {name}, {title}."
            blocks.append(Block(table=Table(caption, ("group", *STYLE_CLASSES), rows), fold=span != "track"))
    text = "KDSC clusters acceleration and jerk and never saw TDBM: P(aggressive) should not rise from left to right."
    return Section("kdsc", "Seen by another method", (text,), tuple(blocks)) if blocks else None


def _features_section(found: Fidelity) -> Section:
    blocks: list[Block] = []
    for one in found.ranges:
        caption = f"{one.group}; drivers per class: {', '.join(str(n) for n in one.drivers)}."
        blocks += picture(ranges_figure(one), caption, heading=one.group)
        rows = tuple(
            (Cell(name, look="head"), *(Cell(f"{100 * share:.0f} %" if math.isfinite(share) else "–", look="number")
                                        for share in one.clamped[k]),
             *(Cell(_span(*one.si[row, k].tolist()), look="number") for row in range(len(STYLE_CLASSES))))
            for k, name in enumerate(one.names)
        )  # fmt: skip
        heads = ("feature", "below the scale", "above the scale", *STYLE_CLASSES)
        table = Table("Share of drivers clamped, and the 5 to 95 % range of each class in SI units", heads, rows)
        blocks.append(Block(table=table, fold=True))
    text = "What a class needs is the 5 to 95 % range of the scaled feature where it has the highest score on the cube."
    return Section("features", "What the traffic left to each class", (text,), tuple(blocks))


def _span(low: float, high: float) -> str:
    return f"{low:.2f} to {high:.2f}" if math.isfinite(low) else "–"


def _robust_section(found: Fidelity) -> Section | None:
    if not found.variants:
        return None
    rows = tuple(
        (Cell(v.name, f"n = {v.agreement.n_drivers}", "head"),
         *(estimate_cell(v.agreement.estimates.get(n)) for n in TITLES))
        for v in found.variants
    )  # fmt: skip
    text = (
        "The same drivers, whole trips, printed orientation, judged by the same frozen scaler, whose ranges were made "
        "with the default options: where a figure falls, the classes rest on that choice or the scale no longer fits. "
        "Wander off: s_center in the middle of its scale for everybody, the other features as driven."
    )
    table = Table("Measured otherwise", ("measured with", *TITLES.values()), rows)
    return Section("robustness", "Measured otherwise", (text,), (Block(table=table),))


def _excluded_section(found: Fidelity) -> Section:
    reasons = sorted({reason for style in found.excluded.values() for reason in style})
    rows = []
    for style in STYLE_CLASSES:
        share = found.share_excluded(style)
        flags = ", ".join(f"{name.lower()} {n}" for name, n in found.outcomes[style].items())
        cells = [Cell(str(found.excluded[style].get(reason, 0)), look="number") for reason in reasons]
        excluded = Cell(f"{100 * share:.1f} %" if math.isfinite(share) else "–", look="number")
        rows.append(
            (Cell(style, look="head"), Cell(str(found.departed[style]), look="number"), *cells, excluded, Cell(flags))
        )
    text = (
        f"{found.unseen} drivers were never logged. Who was logged for under 20 s because the recording began or "
        "ended, or because he left the road, was not to be judged; the share excluded counts the others."
    )
    table = Table(
        "Drivers by style and reason", ("style", "logged", *reasons, "excluded", "judged although"), tuple(rows)
    )
    return Section("excluded", "Who is not judged", (text,), (Block(table=table),))


def _provenance_section(found: Fidelity) -> Section:
    about = found.about
    facts = {**about["corpus"], "scenarios": ", ".join(about["scenarios"]), **about["bootstrap"]}
    scalers = {
        name: one["sha256"] + "".join(f"; no {c} drivers, scaled by all" for c in one["borrowed_contexts"])
        for name, one in about["labelers"].items()
    }
    raw = json.dumps(about["labelers"], indent=1, sort_keys=True)
    blocks = (
        Block(table=facts_table("Corpus", {k: v for k, v in facts.items() if k != "population"})),
        Block(table=facts_table("Frozen labellers, sha256", scalers)),
        Block(caption="What they were fitted on", raw=raw),
    )
    return Section("provenance", "What was judged, by what", (), blocks)
