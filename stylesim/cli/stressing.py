"""`stress`: forecasters in edge-case traffic of every style."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import progress_bar, say
from stylesim.errors import InputError

if TYPE_CHECKING:
    from stylesim.corpus import Corpus
    from stylesim.scene import Scene


def stress(
    forecaster: list[str] = typer.Argument(help="Forecasters, as for `evaluate`."),
    out: Path = typer.Option(..., "--out", help="Folder of the report; must not exist."),
    corpus: Path | None = typer.Option(None, help="Take this generated corpus in place of simulating edge cases."),
    split: str = typer.Option("all", help="Of --corpus: train, val, test, or all of it."),
    quick: bool = typer.Option(False, help="3 episodes of each kind in place of 10: a first look."),
    traffic: Path | None = typer.Option(
        None, help="Folder for the simulated traffic, taken up again if it is there; OUT.traffic without it."
    ),
    history: float = typer.Option(5.0, min=0.1, help="Seconds of history that the forecasters see."),
    future: float = typer.Option(6.0, min=0.1, help="Seconds to forecast; cut to the shortest horizon among them."),
    stride: float = typer.Option(3.0, min=0.1, help="Seconds from one t0 of a scene to the next."),
    fit_on: Path | None = typer.Option(
        None,
        help="Corpus that kinematic_fan is fitted on (its train split, if it has one); without it everyday traffic "
        "of its own is simulated, or the train split of --corpus is taken.",
    ),
    workers: int = typer.Option(1, min=1, help="Processes that simulate; changes no result."),
    seed: int = typer.Option(0, min=0, help="Of the traffic and the bootstrap."),
) -> None:
    """Stress-test forecasters: edge cases in every style; who is forecast worst, and do they know? JSON and HTML."""
    from stylesim.corpus import Corpus
    from stylesim.corpus.files import new_folder
    from stylesim.evaluation.evaluate import common_spec
    from stylesim.evaluation.stress_corpora import fitting_traffic, generate_traffic, own_traffic
    from stylesim.forecast import horizon_s
    from stylesim.forecasting.opening import open_forecaster
    from stylesim.report.stress_page import finding
    from stylesim.report.stressing import stress as run
    from stylesim.windows import WindowSpec

    new_folder(out)
    spec = WindowSpec(history, future, stride)
    folder = traffic or out.with_name(out.name + ".traffic")
    given = None if corpus is None else Corpus(corpus)
    known = None if fit_on is None else Corpus(fit_on)
    with progress_bar("stress test", "scenes") as bar:
        shown = ""

        def tell(title: str, done: int, total: int) -> None:
            nonlocal shown
            if title != shown:
                shown = title
                bar.stage(title, "episodes" if title.startswith("simulating") else "scenes")
            bar(done, total)

        def simulated() -> Iterable[Scene]:
            return chain(*fitting_traffic(folder, seed=seed, workers=workers, progress=tell))

        fitting = simulated if given is None and known is None else _training(known, given)
        models = [open_forecaster(name, train=fitting, spec=spec) for name in forecaster]
        if given is not None:
            crowd = own_traffic(given if split == "all" else given.split(split))
        else:
            crowd = generate_traffic(folder, seed=seed, quick=quick, workers=workers, resume=True, progress=tell)
        found = run(models, crowd, spec=spec, seed=seed, out=out, progress=tell)
    judged = common_spec(models, spec).future_s
    if judged < spec.future_s:
        shortest = min(models, key=horizon_s).name
        say(f"judged up to {judged:g} s, the horizon of {shortest}; {spec.future_s:g} s were asked for")
    for one in found:
        say(finding(one))
    say(f"{out / 'report.html'}")


def _training(fit_on: Corpus | None, examined: Corpus | None) -> Callable[[], Iterable[Scene]] | None:
    """The scenes to fit on; None where the examined corpus would have to be its own training."""
    from stylesim.forecasting.opening import training_split

    if fit_on is not None:
        if examined is not None and fit_on.fingerprint == examined.fingerprint:
            raise InputError("--fit-on and --corpus are one corpus: what is fitted on it cannot be judged on it")
        return training_split(fit_on) or (lambda: fit_on)
    return None if examined is None else training_split(examined)


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command(
        "stress",
        epilog="Example: `stylesim stress constant_velocity runs/model mine:factory --quick --out runs/stress`",
    )(stress)
