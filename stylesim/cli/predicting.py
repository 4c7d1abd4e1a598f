"""`predict`: forecasts of a corpus in files, also "what if everyone drove like that"."""

from __future__ import annotations

from pathlib import Path

import typer

from stylesim.cli.console import progress_bar, say


def predict(
    forecaster: str = typer.Argument(help="A trained model's folder, a baseline, an entry point or a model file."),
    corpus: Path = typer.Argument(help="A corpus."),
    out: Path = typer.Option(..., "--out", help="Folder of the new files, one per style; must not exist."),
    style: list[str] = typer.Option(
        ["history"],
        help="history (what each driver's history shows), none, a class such as timid (what if everyone were), "
        "marginal (the average over the classes), or all of them; may be repeated.",
    ),
    split: str = typer.Option("all", help="Split to forecast: train, val, test, or all for the whole corpus."),
    history: float = typer.Option(5.0, min=0.1, help="Seconds of history that the forecaster sees."),
    future: float = typer.Option(6.0, min=0.1, help="Seconds to forecast."),
    stride: float = typer.Option(3.0, min=0.1, help="Seconds from one t0 of a scene to the next."),
) -> None:
    """Forecast a corpus, as it is or as if everyone had another style; Parquet files that `evaluate` reads."""
    from stylesim.corpus import Corpus
    from stylesim.forecasting.opening import open_forecaster, training_split
    from stylesim.forecasting.predicting import predict as run
    from stylesim.windows import WindowSpec

    opened = Corpus(corpus)
    view = opened if split == "all" else opened.split(split)
    spec = WindowSpec(history, future, stride)
    model = open_forecaster(forecaster, train=training_split(opened), spec=spec)
    with progress_bar("forecasting", "scenes") as bar:
        files = run(model, view, out=out, styles=style, spec=spec, progress=bar)
    for path in files.values():
        say(f"{path}")


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command(
        "predict", epilog="Example: `stylesim predict runs/model runs/mixed --style timid --out runs/if_timid`"
    )(predict)
