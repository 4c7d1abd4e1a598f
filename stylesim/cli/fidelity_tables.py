"""The tables of `fidelity` on stdout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from stylesim.cli.console import say, show_table
from stylesim.style import STYLE_CLASSES

if TYPE_CHECKING:
    from stylesim.evaluation.fidelity_agreement import Agreement
    from stylesim.evaluation.fidelity_results import Fidelity
    from stylesim.evaluation.freedom import Freedom
    from stylesim.evaluation.intervals import Estimate


def _text(value: Estimate, target: float | None = None) -> str:
    """`0.81 [0.79, 0.83]`, with the target where there is one."""
    from stylesim.evaluation.results import interval_text

    return interval_text(value) + ("" if target is None else f" (≥ {target:.2f})")


def _agreements(title: str, found: Sequence[Agreement]) -> None:
    """The six-class figures of every group."""
    from stylesim.evaluation.fidelity_targets import targets_of, verdict

    rows = []
    for one in found:
        wanted = targets_of(one.group) if (one.method, one.span) == ("tdbm", "track") else {}
        figures = one.estimates
        if not figures:
            rows.append([one.group, one.n_drivers, one.n_units, *[""] * 8])
            continue
        rows.append([
            one.group, one.n_drivers, one.n_units, min(one.per_class), one.classes_present,
            _text(figures["balanced_accuracy"], wanted.get("balanced_accuracy")),
            _text(figures["kappa"], wanted.get("kappa")), _text(figures["class_rank"]),
            f"{figures['class_to_a'].value:.2f} of {figures['class_to_a_ceiling'].value:.2f}",
            _text(figures["knob_to_a"], wanted.get("knob_to_a")), verdict(one) if wanted else "",
        ])  # fmt: skip
    columns = ("group", "drivers", "units", "least n", "classes", "balanced accuracy", "κ quadratic", "ρ class ranks",
               "ρ rank~a of ceiling", "ρ knob~a", "target")  # fmt: skip
    show_table(title, columns, rows)


def _confusion(one: Agreement) -> None:
    """Measured shares of each commanded class, in percent."""
    rows = [
        [style, n, *(f"{100 * cell / n:.0f}" if n else "" for cell in counts)]
        for style, n, counts in zip(STYLE_CLASSES, one.per_class, one.count, strict=True)
    ]
    title = f"{one.method} by {one.reference}, {one.group}, whole trips: % of commanded (rows) that measured as"
    show_table(title, ("commanded", "n", *one.measured), rows)


def _left_out(found: Fidelity) -> None:
    from stylesim.evaluation.fidelity_targets import EXCLUDED_AT_MOST

    reasons = sorted({reason for style in found.excluded.values() for reason in style})
    rows = [
        [
            style, found.departed[style], *(found.excluded[style].get(reason, 0) for reason in reasons),
            f"{100 * found.share_excluded(style):.1f}",
            ", ".join(f"{name.lower()} {n}" for name, n in found.outcomes[style].items()),
        ]
        for style in STYLE_CLASSES
    ]  # fmt: skip
    columns = ("style", "logged", *reasons, f"excluded % (≤ {100 * EXCLUDED_AT_MOST:g})", "judged although")
    show_table("Who is not judged, and why", columns, rows)
    if found.unseen:
        say(f"{found.unseen} drivers were never logged (not inserted, or gone before the log began).")


def _ranges(found: Fidelity) -> None:
    """What each class needs of each feature, and what its drivers had."""
    from stylesim.evaluation.fidelity_ranges import needed_ranges

    needs = needed_ranges()
    for one in found.ranges:
        rows = [
            [
                style,
                n,
                *(f"{_span(*needs[i, k].tolist())} | {_span(*one.left[i, k].tolist())}" for k in range(len(one.names))),
            ]
            for i, (style, n) in enumerate(zip(STYLE_CLASSES, one.drivers, strict=True))
        ]
        clamped = [f"{100 * low:.0f} % below, {100 * high:.0f} % above" for low, high in one.clamped]
        rows.append(["clamped", sum(one.drivers), *clamped])
        title = f"{one.group}: scaled features, 5 to 95 %: what the class needs | what its drivers had"
        show_table(title, ("commanded", "n", *one.names), rows)


def _span(low: float, high: float) -> str:
    return f"{low:.2f}–{high:.2f}" if low == low else "–"


def _robust(found: Fidelity) -> None:
    if found.variants:
        rows = [
            [v.name, v.agreement.n_drivers,
             *(_text(v.agreement.estimates[k]) for k in ("balanced_accuracy", "kappa", "knob_to_a"))]
            for v in found.variants
        ]  # fmt: skip
        title = "The same drivers measured otherwise, judged by the same frozen scaler (whole trips, printed)"
        show_table(title, ("measured with", "drivers", "balanced accuracy", "κ quadratic", "ρ knob~a"), rows)


def show_fidelity(found: Fidelity) -> None:
    """Every table on stdout."""
    from stylesim.evaluation.fidelity_results import EVERYONE

    names = {"tdbm": "TDBM, printed orientation", "tdbm_transposed": "TDBM, transposed"}
    spans = {"track": "whole trips", "window": "11 s windows"}
    references = list(dict.fromkeys(one.reference for one in found.agreements))
    for reference in references:
        for method in ("tdbm", "tdbm_transposed"):
            for span in ("track", "window"):
                listed = found.of(method=method, reference=reference, span=span)
                if listed:
                    _agreements(f"{names[method]}, {reference}, {spans[span]}", listed)
        listed = found.of(method="kdsc", reference=reference)
        if listed:
            aggressive = f"{listed[0].measured[0]}|"
            rows = [
                [one.group, *(_text(one.estimates[aggressive + s]) if one.estimates else "" for s in STYLE_CLASSES)]
                for one in listed
            ]
            show_table(f"KDSC, {reference}: share aggressive by commanded class", ("group", *STYLE_CLASSES), rows)
    for name, one_labeler in found.about["labelers"].items():
        for context in one_labeler["borrowed_contexts"]:
            say(f"{name} was fitted on no {context} traffic: there its scale is that of all its drivers together.")
    for one in found.agreements:
        if one.span == "track" and one.group == EVERYONE and one.n_drivers:
            _confusion(one)
    _left_out(found)
    _ranges(found)
    _robust(found)


def show_room(room: Sequence[Freedom]) -> None:
    """What one neutral driver's vehicle reached at the extremes, and which classes have no freedom."""
    for one in room:
        rows = [
            [name, f"{low:.2f}", f"{high:.2f}", *by]
            for name, (low, high), by in zip(one.names, one.reached.tolist(), one.best, strict=True)
        ]
        title = f"{one.scenario}: scaled features that a neutral driver's vehicle reaches at the extremes"
        show_table(f"{title} ({one.drives} drives)", ("feature", "least", "greatest", "least by", "greatest by"), rows)
        lead = ", ".join(f"{name} {margin:.2f}" for name, margin in one.margin.items())
        say(f"{one.scenario}: no freedom for {', '.join(one.without()) or 'no class'} (greatest lead: {lead})")
