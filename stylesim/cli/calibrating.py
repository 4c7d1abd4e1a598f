"""`calibrate`: behaviours with which drivers measure as commanded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import progress_bar, say, show_table
from stylesim.style import STYLE_CLASSES

if TYPE_CHECKING:
    from stylesim.calibration.checking import Check


def _show(one: Check) -> None:
    from stylesim.evaluation.results import interval_text

    rows = []
    for found in one.agreements:
        span = "whole trips" if found.span == "track" else "11 s windows"
        names = ("balanced_accuracy", "kappa", "knob_to_a")
        figures = [interval_text(found.estimates[name]) if found.estimates else "" for name in names]
        rows.append((found.group, span, found.n_drivers, min(found.per_class), found.classes_present, *figures))
    columns = ("group", "of", "drivers", "least n", "classes", "balanced accuracy", "κ quadratic", "ρ knob~a")
    show_table(f"{one.name} (seed {one.seed})", columns, rows)
    first = one.agreements[0]
    shares = [
        [style, *(f"{100 * n / max(1, total):.0f}" for n in counts)]
        for style, total, counts in zip(STYLE_CLASSES, first.per_class, first.count, strict=True)
    ]
    show_table("% of commanded (rows) that measured as", ("commanded", *first.measured), shares)
    if one.kdsc_aggressive:
        kdsc = [[name, f"{share:.3f}"] for name, share in one.kdsc_aggressive.items()]
        show_table("Share that KDSC, fitted on recordings, calls aggressive", ("commanded", "share"), kdsc)


def calibrate(
    backend: str = typer.Option(..., help="sumo or highway."),
    out: Path = typer.Option(..., "--out", help="The calibration file to write; must not exist."),
    scenario: list[str] = typer.Option(
        [],
        "--scenario",
        help="To calibrate on, by name or folder; several times.",
        show_default="those held to targets",
    ),
    held_out: str = typer.Option("", help="A scenario that only judges.", show_default="lane_drop, hw_exit"),
    scaler: str = typer.Option("sim-reference", help="The frozen TDBM that judges: a shipped reference or a .json."),
    start: Path | None = typer.Option(None, help="Go on from this calibration file."),
    rounds: int = typer.Option(14, min=1, help="Rounds of trial traffic."),
    episodes: int = typer.Option(3, min=1, help="Episodes per scenario and round."),
    check_episodes: int = typer.Option(6, min=3, help="Episodes per scenario of each check."),
    seed: int = typer.Option(990_100, min=0, help="Of the first round; the following rounds take the following ones."),
    workers: int = typer.Option(1, min=1, help="Simulations side by side."),
    report: Path | None = typer.Option(None, help="Also write the figures as JSON to this file."),
) -> None:
    """Calibrate the behaviours of the six classes until drivers measure as the class that was commanded."""
    from stylesim.calibration import calibrate as run
    from stylesim.corpus.files import write_whole

    with progress_bar("calibrating", "rounds") as bar:

        def progress(stage: str, done: int, total: int) -> None:
            if not done:
                bar.stage(stage, "rounds" if stage == "calibrating" else "checks")
            bar(done, total)

        found = run(
            backend, out=out, scenarios=scenario, held_out=held_out, scaler=scaler, start=start, rounds=rounds,
            episodes=episodes, check_episodes=check_episodes, seed=seed, workers=workers, progress=progress,
        )  # fmt: skip
    rows = [
        (n, r["drivers"], f"{r['balanced_accuracy']:.3f}", *(f"{x:.2f}" for x in r["recall"]))
        for n, r in enumerate(found.rounds, start=1)
    ]
    show_table("Rounds (search widths shrink)", ("round", "drivers", "balanced accuracy", *STYLE_CLASSES), rows)
    for one in found.checks:
        _show(one)
    if report is not None:
        content = {"rounds": list(found.rounds), "checks": {c.name: c.to_dict() for c in found.checks}}
        write_whole(report, json.dumps(content, indent=1, sort_keys=True).encode())
    say(f"calibration: {found.path}; drive by it with `stylesim generate … --calibration {found.path}`")


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command("calibrate", epilog="Example: `stylesim calibrate --backend sumo --out my-styles.yaml`")(calibrate)
