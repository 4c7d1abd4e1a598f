"""`realism`: simulated traffic against recordings."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import progress_bar, say, show_table
from stylesim.cli.figures import check_endings, write_figures

if TYPE_CHECKING:
    from stylesim.evaluation.exposure import Rate
    from stylesim.evaluation.realism_results import Realism, Spread


def _text(value: Spread) -> str:
    if not math.isfinite(value.value):
        return "–"
    ends = f" [{value.low:.2f}, {value.high:.2f}]" if math.isfinite(value.low) else ""
    return f"{value.value:.2f}{ends}"


def _rate(rate: Rate) -> str:
    return f"{rate.value:.3g} [{rate.low:.3g}, {rate.high:.3g}] ({rate.events} in {1000 * rate.exposure:.1f} km)"


def show_realism(found: Realism) -> None:
    """Every table on stdout."""
    from stylesim.evaluation.realism_quantities import QUANTITIES

    for one in found.comparisons:
        what = "stretches of time" if one.within_unit else "units"
        rows = [
            [
                f"{QUANTITIES[q.quantity].title} ({QUANTITIES[q.quantity].unit})", _text(q.distance), _text(q.matched),
                f"{100 * q.covered:.0f}", _text(q.floor), f"{q.likelihood:.3f} of {q.best_likelihood:.3f}",
                f"{q.sim_seconds / 60:.0f}/{q.real_seconds / 60:.1f}",
            ]
            for q in one.quantities
        ]  # fmt: skip
        title = f"{found.sim} against {one.real} ({one.blocks} {what}): Wasserstein-1"
        columns = ("quantity", "distance", "matched by speed, density", "covered %", "floor: real against real",
                   "likelihood of best", "min sim/real")  # fmt: skip
        show_table(title, columns, rows)
        rows = [
            [r.name, f"{r.sim:.2f}", f"{r.real:.2f}", _text(r.ratio), f"± {100 * r.within:.0f} %",
             {True: "met", False: "missed", None: "–"}[r.met]]
            for r in one.ratios
        ]  # fmt: skip
        show_table(f"Against {one.real}, matched", ("figure", "sim", "real", "ratio", "target", ""), rows)
        rows = [
            [s.style, f"{s.sim_drivers}/{s.real_drivers}",
             *("too few" if s.matched is None else _text(s.matched[name]) for name in QUANTITIES)]
            for s in one.styles
        ]  # fmt: skip
        show_table(f"Matched distance to {one.real} per measured style", ("style", "sim/real", *QUANTITIES), rows)
    if found.between_recordings:
        rows = [
            [" – ".join(pair), *(f"{values[name]:.2f}" for name in QUANTITIES)]
            for pair, values in found.between_recordings.items()
        ]
        show_table("Matched distance between recordings", ("recordings", *QUANTITIES), rows)
    rows = [[found.sim, _rate(found.collisions)], *([one.real, _rate(one.collisions)] for one in found.comparisons)]
    show_table("Boxes of motor vehicles that come to overlap, per 1,000 km", ("corpus", "rate"), rows)


def realism(
    sim: Path = typer.Argument(help="A simulated corpus."),
    real: list[Path] = typer.Argument(help="Recorded corpora (`stylesim read`)."),
    out: Path | None = typer.Option(None, "--out", help="Write every figure as JSON to this file."),
    report: Path | None = typer.Option(None, "--report", help="Write an HTML page with figures to this file."),
    reference: str = typer.Option(
        "",
        help="Frozen scaler that measures styles; without it real-reference. It has towns only: for motorways "
        "sim-reference.",
    ),
    seed: int = typer.Option(0, min=0, help="Of the bootstrap and the splits of the floor."),
) -> None:
    """How far simulated traffic is from recordings, and recordings from each other, matched by speed and density."""
    from stylesim.corpus import Corpus
    from stylesim.evaluation.realism import realism as run

    check_endings(out, report)
    opened, recorded = Corpus(sim), [Corpus(path) for path in real]
    with progress_bar("measuring", "scenes") as progress:
        found = run(opened, recorded, reference=reference, seed=seed, progress=progress.told)
    show_realism(found)
    write_figures(out, found.to_dict())
    if report is not None:
        from stylesim.report.realism_page import save_realism

        say(f"{save_realism(found, report)}")


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command("realism", epilog="Example: `stylesim realism runs/sim runs/real --report realism.html`")(realism)
