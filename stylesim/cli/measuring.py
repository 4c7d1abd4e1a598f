"""`fidelity`: whether drivers drive as they were commanded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import progress_bar, say
from stylesim.cli.fidelity_tables import show_fidelity, show_room
from stylesim.cli.figures import check_endings, write_figures

if TYPE_CHECKING:
    from stylesim.evaluation.fidelity_results import Fidelity
    from stylesim.evaluation.freedom import Freedom


def _room(found: Fidelity, episodes: int, seed: int, tell: Callable[[str, int, int], None]) -> tuple[Freedom, ...]:
    from stylesim.evaluation.freedom import freedom as run

    return run(found.about["scenarios"], episodes=episodes, seed=seed, progress=tell)


def fidelity(
    corpus: Path = typer.Argument(help="A generated corpus."),
    scenario: list[str] = typer.Option([], help="Only these scenarios, repeatable; without it all."),
    out: Path | None = typer.Option(None, "--out", help="Write every figure as JSON to this file."),
    report: Path | None = typer.Option(None, "--report", help="Write an HTML page with figures to this file."),
    robustness: bool = typer.Option(
        True, help="Also measure the same drivers with other smoothers, windows, weights and radii (10 more passes)."
    ),
    freedom: int = typer.Option(
        0, min=0, help="Episodes per scenario to drive at every extreme (about 45 runs each): which classes have room."
    ),
    seed: int = typer.Option(0, min=0, help="Of the bootstrap of the intervals, and of --freedom."),
) -> None:
    """Do drivers measure as commanded? Judged by the shipped frozen scalers, on all drivers logged for 20 s."""
    from stylesim.corpus import Corpus
    from stylesim.evaluation.fidelity import fidelity as run

    check_endings(out, report)
    opened = Corpus(corpus)
    with progress_bar("measuring", "scenes") as progress:
        found = run(opened, scenarios=tuple(scenario), with_robustness=robustness, seed=seed, progress=progress.told)
        room = _room(found, freedom, seed, progress.told) if freedom else ()
    show_fidelity(found)
    show_room(room)
    write_figures(out, {**found.to_dict(), "freedom": [one.to_dict() for one in room]})
    if report is not None:
        from stylesim.report.fidelity_page import save_fidelity

        say(f"{save_fidelity(found, report)}")


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command("fidelity", epilog="Example: `stylesim fidelity runs/sim --report fidelity.html`")(fidelity)
