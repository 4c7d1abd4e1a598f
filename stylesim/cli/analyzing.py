"""`analyze`: styles in data sets."""

from __future__ import annotations

from pathlib import Path

import typer

from stylesim.cli.console import progress_bar, say, show_table


def analyze(
    corpora: list[Path] = typer.Argument(help="Corpora, simulated or recorded."),
    out: Path = typer.Option(..., "--out", help="New folder for index.html, figures/*.png and tables/*.parquet."),
    reference: str = typer.Option("real-reference", help="Frozen scaler that judges TDBM."),
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

        found = run(opened, reference=reference, with_sensitivity=sensitivity, seed=seed, progress=tell)
    for text in found.about["warnings"]:
        say(f"warning: {text}")
    rows = [
        [row["corpus"], row["orientation"], row["class"], row["n_drivers"], _text(row)]
        for row in found.tables["class_shares"].iter_rows(named=True)
    ]
    show_table("TDBM classes", ("corpus", "orientation", "class", "drivers", "share %"), rows)
    for name, about in found.about["corpora"].items():
        say(f"{name}: " + ", ".join(f"{n} {what}" for what, n in about["counts"].items()))
    say(f"{save_analysis(found, out)}")


def _text(row: dict[str, float | str | None]) -> str:
    value, low, high = (row[key] for key in ("value", "low", "high"))
    if not isinstance(value, float) or not isinstance(low, float) or not isinstance(high, float):
        return str(row["status"])
    mark = " †" if row["status"] == "within site" else ""
    return f"{100 * value:.0f} [{100 * low:.0f}, {100 * high:.0f}]{mark}"


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command("analyze", epilog="Example: `stylesim analyze runs/real runs/sim --out runs/analysis`")(analyze)
