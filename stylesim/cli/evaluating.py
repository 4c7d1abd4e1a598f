"""`evaluate`, `render`: the report of how forecasters do by style, and a picture of a scene."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import Bar, progress_bar, say, show_table
from stylesim.errors import InputError

if TYPE_CHECKING:
    from stylesim.report.evaluate import Report
    from stylesim.report.tables import Cell


def evaluate(
    forecaster: list[str] = typer.Argument(
        help="Forecasters, and last the corpus. A forecaster is a model folder, a baseline (constant_velocity, "
        "constant_turn_rate, lane_following, idm_rollout, kinematic_fan), an entry point pkg.module:factory, a model "
        "file (.pt, .pt2, .onnx), or a file of predictions (Argoverse 2 .parquet, Waymo .binproto or .tar.gz)."
    ),
    by: str = typer.Option(
        "tdbm",
        help="Strata, comma-separated: tdbm, kdsc, history:tdbm, history:kdsc, tdbm:transposed, "
        "scenario, source, kind, commanded; crossed with *: tdbm*scenario.",
    ),
    split: str = typer.Option("test", help="Split to evaluate: train, val, test, or all for the whole corpus."),
    history: float = typer.Option(5.0, min=0.1, help="Seconds of history that the forecasters see."),
    future: float = typer.Option(6.0, min=0.1, help="Seconds to forecast; cut to the shortest horizon among them."),
    stride: float = typer.Option(3.0, min=0.1, help="Seconds from one t0 of a scene to the next."),
    placebo: bool = typer.Option(
        True, help="Ask a model that is told of styles once more with the styles of other drivers."
    ),
    seed: int = typer.Option(0, min=0, help="Of the bootstrap."),
    out: Path = typer.Option(..., "--out", help="Folder of the report; must not exist."),
) -> None:
    """Evaluate forecasters by style: tables with n and 95 % intervals, JSON, Markdown, Parquet and an HTML report."""
    from stylesim.corpus import Corpus
    from stylesim.corpus.files import new_folder
    from stylesim.evaluation.evaluate import common_spec
    from stylesim.forecast import horizon_s
    from stylesim.forecasting.opening import open_forecaster, training_split
    from stylesim.report.evaluate import evaluate as run
    from stylesim.report.tables import error_table
    from stylesim.windows import WindowSpec

    if len(forecaster) < 2:
        raise InputError("give at least one forecaster and, last, the corpus")
    final, partial = new_folder(out)
    if any((partial / name).exists() for name in ("request.json", "training.json")):
        raise InputError(f"{partial} is left from an unfinished run of another verb; finish it, or remove it")
    *names, corpus_path = forecaster
    corpus = Corpus(corpus_path)
    view = corpus if split == "all" else corpus.split(split)
    spec = WindowSpec(history, future, stride)
    models = [open_forecaster(name, train=training_split(corpus), spec=spec) for name in names]
    judged = common_spec(models, spec)
    if judged.future_s < spec.future_s:
        shortest = min(models, key=horizon_s).name
        say(f"judged up to {judged.future_s:g} s, the horizon of {shortest}; {spec.future_s:g} s were asked for")
    strata = tuple(part.strip() for part in by.split(",") if part.strip())
    if not strata:
        raise InputError("--by: name at least one stratum, such as tdbm or scenario")
    with progress_bar("evaluating", "scenes") as bar:
        report = run(models, view, by=strata, spec=spec, seed=seed, placebo=placebo, progress=_by_forecaster(bar))
    _save(report, partial, final)
    for stratum in strata:
        table = error_table(report.evaluations, stratum)
        show_table(table.caption, table.headings, [_texts(row, len(table.headings)) for row in table.rows])
    say(f"{out / 'report.html'}")


def _by_forecaster(bar: Bar) -> Callable[[str, int, int], None]:
    """A callback that gives each forecaster a line of its own."""
    shown = ""

    def update(name: str, done: int, total: int) -> None:
        nonlocal shown
        if name != shown:
            shown = name
            bar.stage(f"evaluating {name}", "scenes")
        bar(done, total)

    return update


def _save(report: Report, partial: Path, final: Path) -> None:
    """The report under its final name, or nothing at all."""
    shutil.rmtree(partial, ignore_errors=True)  # of a run that was killed
    try:
        report.save(partial / "report.html")
        partial.rename(final)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _texts(row: Sequence[Cell], width: int) -> list[str]:
    """The cells of a report's row as text; a cell that spans rows above is empty."""
    texts = [f"{cell.text}\n{cell.note}" if cell.note else cell.text for cell in row]
    return [""] * (width - len(texts)) + texts


def render(
    corpus: Path = typer.Argument(help="A corpus."),
    scene: str | None = typer.Option(None, help="Scene id; the first scene without it."),
    out: Path = typer.Option(..., "--out", help="Picture to write (.png or .svg)."),
) -> None:
    """Draw a scene: road, lights and tracks coloured by style."""
    from stylesim.corpus import Corpus
    from stylesim.report.picture import save_picture

    opened = Corpus(corpus)
    shown = opened.scene(scene or opened.info[0].scene_id)
    labels = opened.labels("tdbm", "track") if opened.has_labels("tdbm", "track") else None
    say(f"{save_picture(shown, out, labels=labels)}")


def add_to(app: typer.Typer) -> None:
    """Register the verbs."""
    app.command(
        "evaluate",
        epilog="Example: `stylesim evaluate constant_velocity runs/model runs/mixed --by tdbm --out runs/report`",
    )(evaluate)
    app.command("render", epilog="Example: `stylesim render runs/sim --out runs/scene.png`")(render)
