"""`compare`, `conformal`: two examinations side by side, and how wide a forecast must be to hold the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import progress_bar, say, show_table
from stylesim.cli.figures import check_endings, write_figures

if TYPE_CHECKING:
    from stylesim.evaluation.comparison import Comparison
    from stylesim.evaluation.intervals import Estimate


def compare(
    ours: Path = typer.Argument(help="An evaluation's .json, or a stress test's .stress.json (in the folder it made)."),
    theirs: Path = typer.Argument(help="Another one's, of the same corpus and windows."),
    by: str | None = typer.Option(None, help="One stratum only; all that both have, without it."),
    seed: int = typer.Option(0, min=0, help="Of the bootstrap."),
    out: Path | None = typer.Option(None, "--out", help="Write every figure as JSON to this file."),
    report: Path | None = typer.Option(None, "--report", help="Write an HTML page with figures to this file."),
) -> None:
    """Paired differences of two forecasters on the same windows, with 95 % intervals; below 0 the first is better."""
    from stylesim.evaluation.comparison import compare as run

    check_endings(out, report)
    found = run(ours, theirs, by=by, seed=seed)
    show_comparison(found)
    write_figures(out, found.to_dict())
    if report is not None:
        from stylesim.report.compare_page import save_comparison

        say(f"{save_comparison(found, report)}")


def show_comparison(found: Comparison) -> None:
    """Every table on stdout."""
    from stylesim.evaluation.permuted import placebo_row
    from stylesim.evaluation.results import HEADINGS, interval_text
    from stylesim.evaluation.slices import ALL
    from stylesim.evaluation.stress_decisions import MEASURES

    names = f"{found.ours.forecaster} minus {found.theirs.forecaster}"

    def tell(title: str, by: str, cells: Mapping[str, Mapping[str, Estimate]], columns: Mapping[str, str]) -> None:
        rows = []
        for value, metrics in cells.items():
            size = next(iter(metrics.values()))
            rows.append(
                (value, f"{size.n_drivers} / {size.n_units}", *(interval_text(metrics[name]) for name in columns))
            )
        show_table(title, (by, "drivers / units", *columns.values()), rows)

    for by, cells in found.cells.items():
        tell(f"{names}, by {by}", by, cells, HEADINGS)
    for (kind, by), cells in found.decisions.items():
        if by in (ALL, "taken"):
            tell(f"{names}: {kind}, by {by}", by, cells, {name: name for name in MEASURES})
    if found.figures:
        rows = [
            (
                one.group,
                one.name,
                *("–" if side is None else interval_text(side, digits=3) for side in (one.ours, one.theirs)),
            )
            for one in found.figures
        ]
        show_table(
            "Beside each other, not paired", ("", "figure", found.ours.forecaster, found.theirs.forecaster), rows
        )
    for one in (found.ours, found.theirs):
        if row := placebo_row(one):
            placebo, told = (interval_text(metrics["min_fde_m"]) for metrics in (row, one.overall.metrics))
            say(f"{one.forecaster}: minFDE {told} m; told other drivers' styles (placebo) {placebo} m")


def conformal(
    forecaster: str = typer.Argument(help="A forecaster, as for `evaluate`."),
    corpus: Path = typer.Argument(help="A corpus with splits."),
    by: str = typer.Option("history:tdbm", help="Groups with a radius of their own: history:tdbm*scenario."),
    alpha: float = typer.Option(0.1, help="1 - alpha is the promised coverage."),
    calibrate_on: str = typer.Option("val", help="Split whose drivers give the radii."),
    test_on: str = typer.Option("test", help="Split on which coverage is measured."),
    history: float = typer.Option(5.0, min=0.1, help="Seconds of history that the forecaster sees."),
    future: float = typer.Option(6.0, min=0.1, help="Seconds to forecast; cut to its horizon."),
    stride: float = typer.Option(3.0, min=0.1, help="Seconds from one t0 of a scene to the next."),
    seed: int = typer.Option(0, min=0, help="Of the drawn windows and the bootstrap."),
    out: Path | None = typer.Option(None, help="JSON to write."),
) -> None:
    """Split-conformal radii about a forecaster's modes, per style, with the coverage measured on held-out drivers."""
    from stylesim.corpus import Corpus
    from stylesim.corpus.files import json_bytes, write_whole
    from stylesim.evaluation.conformal import conformal as run
    from stylesim.evaluation.results import interval_text
    from stylesim.forecasting.opening import open_forecaster, training_split
    from stylesim.windows import WindowSpec

    opened, spec = Corpus(corpus), WindowSpec(history, future, stride)
    model = open_forecaster(forecaster, train=training_split(opened), spec=spec)
    with progress_bar("forecasting", "scenes") as progress:
        report = run(
            model, opened, by=by, alpha=alpha, calibrate_on=calibrate_on, test_on=test_on, spec=spec, seed=seed,
            progress=progress,
        )  # fmt: skip
    rows = []
    for region in report.regions:
        own = "too few" if math.isnan(region.radius_m) else f"{region.radius_m:.2f}"
        covered = "–" if region.coverage is None else interval_text(region.coverage)
        judged = f"{region.pooled_coverage.n_drivers} / {region.pooled_coverage.n_units}"
        rows.append(
            (region.group, str(region.calibration_drivers), own, judged, covered, interval_text(region.pooled_coverage))
        )
    pooled = report.about["pooled_radius_m"]
    show_table(
        f"{model.name}: discs that hold {1 - alpha:.0%} of the final positions; all together {pooled:.2f} m",
        (by, "calibration drivers", "radius (m)", "test drivers / units", "coverage", "coverage, one radius for all"),
        rows,
    )
    if out is not None:
        write_whole(out, json_bytes(report.to_dict()))
        say(f"{out}")


def add_to(app: typer.Typer) -> None:
    """Register the verbs."""
    app.command(
        "compare",
        epilog="Example: `stylesim compare runs/stress/mine.stress.json runs/stress/constant_velocity.stress.json "
        "--report runs/compare.html`",
    )(compare)
    app.command("conformal", epilog="Example: `stylesim conformal runs/model runs/mixed --by history:tdbm*scenario`")(
        conformal
    )
