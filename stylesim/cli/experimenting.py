"""`placebo`: does a forecaster gain from styles that have no effect?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import progress_bar, say, show_table

if TYPE_CHECKING:
    from stylesim.experiments.placebo import Check


def placebo(
    world: Path = typer.Argument(help="A merged corpus (with splits) generated with --population placebo."),
    control: Path = typer.Argument(help="One generated the same way with another population: the positive control."),
    out: Path = typer.Option(..., "--out", help="Folder of the runs; the same command again goes on in it."),
    condition: str = typer.Option("tdbm", help="What the tested model is told (see `stylesim train --condition`)."),
    fusion: str = typer.Option("early", help="Where the style enters the network: early, mid or late."),
    seeds: int = typer.Option(5, min=1, help="Trainings of each arm, with the seeds 0, 1, ..."),
    steps: int = typer.Option(400, min=1, help="Batches of each training."),
    size: str = typer.Option("mini", help="mini, tiny, small or base."),
    margin: float = typer.Option(
        0.015, min=1e-6, help="The 90 % interval of the relative change must lie within ± this."
    ),
    history: float = typer.Option(5.0, min=0.1, help="Seconds of history that the model sees."),
    future: float = typer.Option(6.0, min=0.1, help="Seconds that it forecasts."),
    stride: float = typer.Option(3.0, min=0.1, help="Seconds from one t0 of a scene to the next."),
) -> None:
    """Train with and without styles where they have no effect and where they have; exits with 1 if it is not passed.

    Passed: no gain where there is none to have, shown by equivalence; the true style found where it matters; and
    nothing gained there with the styles of other drivers.
    """
    from stylesim.corpus import Corpus
    from stylesim.corpus.files import json_bytes, write_whole
    from stylesim.experiments.placebo import placebo as run
    from stylesim.windows import WindowSpec

    with progress_bar("training", "runs") as bar:

        def follow(name: str, done: int, total: int) -> None:
            bar.stage(name, "runs")
            bar(done, total)

        found = run(
            Corpus(world),
            Corpus(control),
            seeds=range(seeds),
            steps=steps,
            out=out,
            condition=condition,
            fusion=fusion,
            size=size,
            spec=WindowSpec(history, future, stride),
            margin=margin,
            progress=follow,
        )
    show_table(
        "Relative change of minFDE; below 0 is a gain",
        ("world", "told", "against", "expected", "change", "drivers / units / seeds", "shown"),
        [_row(check) for check in found.checks],
    )
    write_whole(out / "placebo.json", json_bytes(found.to_dict()))
    say(f"{out / 'placebo.json'}: {'passed' if found.passed else 'not passed'}")
    if not found.passed:
        raise typer.Exit(1)


def _row(check: Check) -> tuple[str, ...]:
    change = check.change
    expected = {
        "nothing": f"within ± {check.margin:.1%}",
        "gain": "a gain",
        "no gain": "no gain",
    }[check.expects]
    text = "too few" if change.refused else f"{change.value:+.1%} [{change.low:+.1%}, {change.high:+.1%}]"
    size = f"{change.n_drivers} / {change.n_units} / {change.n_seeds}"
    return (
        check.world,
        check.arm,
        check.against,
        expected,
        f"{text} ({change.level:.0%})",
        size,
        "yes" if check.passed else "no",
    )


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command(
        "placebo", epilog="Example: `stylesim placebo runs/placebo runs/mixed --condition tdbm --out runs/placebo-test`"
    )(placebo)
