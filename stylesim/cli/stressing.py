"""`stress`: forecasters in edge-case traffic of every style."""

from __future__ import annotations

from pathlib import Path

import typer

from stylesim.cli.console import progress_bar, say


def stress(
    forecaster: list[str] = typer.Argument(help="Forecasters, as for `evaluate`."),
    out: Path = typer.Option(..., "--out", help="Folder of the report; must not exist."),
    corpus: Path | None = typer.Option(None, help="Take this generated corpus in place of simulating edge cases."),
    quick: bool = typer.Option(False, help="3 episodes of each kind in place of 10: a first look."),
    traffic: Path | None = typer.Option(
        None, help="Folder for the simulated traffic, taken up again if it is there; OUT.traffic without it."
    ),
    history: float = typer.Option(5.0, min=0.1, help="Seconds of history that the forecasters see."),
    future: float = typer.Option(6.0, min=0.1, help="Seconds to forecast; cut to the shortest horizon among them."),
    stride: float = typer.Option(3.0, min=0.1, help="Seconds from one t0 of a scene to the next."),
    workers: int = typer.Option(1, min=1, help="Processes that simulate; changes no result."),
    seed: int = typer.Option(0, min=0, help="Of the traffic and the bootstrap."),
) -> None:
    """Stress-test forecasters: edge cases in every style; who is forecast worst, and do they know? JSON and HTML."""
    from stylesim.corpus import Corpus
    from stylesim.corpus.files import new_folder
    from stylesim.evaluation.stress_corpora import generate_traffic, own_traffic
    from stylesim.forecasting.opening import open_forecaster
    from stylesim.report.stress_page import finding
    from stylesim.report.stressing import run_stress
    from stylesim.windows import WindowSpec

    new_folder(out)
    spec = WindowSpec(history, future, stride)
    models = [open_forecaster(name, spec=spec) for name in forecaster]
    with progress_bar("stress test", "scenes") as bar:
        shown = ""

        def tell(title: str, done: int, total: int) -> None:
            nonlocal shown
            if title != shown:
                shown = title
                bar.stage(title, "episodes" if title.startswith("simulating") else "scenes")
            bar(done, total)

        if corpus is not None:
            crowd = own_traffic(Corpus(corpus))
        else:
            folder = traffic or out.with_name(out.name + ".traffic")
            crowd = generate_traffic(folder, seed=seed, quick=quick, workers=workers, resume=True, progress=tell)
        found = run_stress(models, crowd, spec=spec, seed=seed, out=out, progress=tell)
    for one in found:
        say(finding(one))
    say(f"{out / 'report.html'}")


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command(
        "stress",
        epilog="Example: `stylesim stress constant_velocity runs/model mine:factory --quick --out runs/stress`",
    )(stress)
