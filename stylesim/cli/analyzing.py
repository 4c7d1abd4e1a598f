"""`analyze`: styles in data sets."""

from __future__ import annotations

from pathlib import Path

import typer

from stylesim.cli.console import progress_bar, say, show_table


def analyze(
    corpora: list[Path] = typer.Argument(help="Corpora, simulated or recorded."),
    out: Path = typer.Option(..., "--out", help="New folder for index.html, figures/*.png and tables/*.parquet."),
    reference: str = typer.Option(
        "real-reference",
        help="What judges TDBM: real-reference, sim-reference (frozen), or within (the corpus' own drivers).",
    ),
    by_source: bool = typer.Option(False, help="Show every source of a merged corpus by itself."),
    sensitivity: bool = typer.Option(
        True, help="Also measure drivers with other smoothers, windows and scalers (6 more passes over ≤ 40 scenes)."
    ),
    seed: int = typer.Option(0, min=0, help="Of bootstraps, permutations and parts."),
) -> None:
    """Styles in data sets: classes, kinematics, clusters, stability, shift; what the paper shows, and what it lacks."""
    from stylesim.corpus import Corpus
    from stylesim.evaluation.analysis.analyze import analyze as run
    from stylesim.report.analysis_page import check_out, save_analysis

    check_out(out)
    opened = [Corpus(path) for path in corpora]
    with progress_bar("measuring", "scenes") as progress:
        last = [""]

        def tell(stage: str, done: int, total: int) -> None:
            if stage != last[0]:
                last[0] = stage
                progress.stage(stage, "scenes" if stage.endswith("measure") else "variants")
            progress(done, total)

        found = run(
            opened, reference=reference, by_source=by_source, with_sensitivity=sensitivity, seed=seed, progress=tell
        )
    for text in found.about["warnings"]:
        say(f"warning: {text}")
    shares = list(found.tables["class_shares"].iter_rows(named=True))
    classes = list(dict.fromkeys(row["class"] for row in shares))
    cells: dict[tuple[str, str, int], list[str]] = {}
    for row in shares:
        cells.setdefault((row["corpus"], row["orientation"], row["n_drivers"]), []).append(_text(row))
    rows = [[corpus, orientation, drivers, *texts] for (corpus, orientation, drivers), texts in cells.items()]
    show_table("Share of each TDBM class (%)", ("corpus", "orientation", "drivers", *classes), rows)
    for name, about in found.about["corpora"].items():
        say(f"{name}: " + ", ".join(f"{n} {what}" for what, n in about["counts"].items()))
    say(f"{save_analysis(found, out)}")


def _text(row: dict[str, float | str | None]) -> str:
    value = row["value"]
    return f"{100 * value:.0f}" if isinstance(value, float) else str(row["status"])


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command("analyze", epilog="Example: `stylesim analyze runs/real runs/sim --out runs/analysis`")(analyze)
