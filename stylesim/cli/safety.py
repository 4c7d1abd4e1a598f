"""`criticality`: how critical the encounters of each style were."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import progress_bar, show_table
from stylesim.cli.figures import check_endings, write_figures

if TYPE_CHECKING:
    from stylesim.evaluation.criticality import Criticality
    from stylesim.evaluation.exposure import Rate


class By(StrEnum):
    """What drivers are sorted by."""

    commanded = "commanded"
    tdbm = "tdbm"
    kdsc = "kdsc"


_MEASURES = {
    "ttc_p5_s": "TTC 5 % (s)",
    "ttc_of_closest_5_percent_s": "TTC min, closest 5 % of drivers (s)",
    "headway_p5_s": "headway 5 % (s)",
    "deceleration_max_mps2": "required deceleration max (m/s²)",
    "pet_min_s": "PET min (s)",
    "pet_of_closest_5_percent_s": "PET min, closest 5 % (s)",
}
_RATES = {
    "collisions_charged": "collisions charged",
    "in_collisions": "in collisions",
    "ttc_conflicts": "TTC < 1.5 s",
    "deceleration_conflicts": "deceleration > 3.35 m/s²",
    "pet_conflicts": "PET < 1 s",
}


def _rate(rate: Rate) -> str:
    """`12.3 [8.0, 18.1] (21)`: the rate, its interval, the events that it rests on."""
    if not math.isfinite(rate.value):
        return "–"
    return f"{rate.value:.3g} [{rate.low:.3g}, {rate.high:.3g}] ({rate.events})"


def show_criticality(found: Criticality) -> None:
    """The tables on stdout."""
    from stylesim.evaluation.results import interval_text

    rows = [
        [one.style, one.drivers, f"{one.km:.1f}", *(interval_text(one.measures[name]) for name in _MEASURES)]
        for one in found.rows
    ]
    title = "Median driver's own figures (closest 5 %: the 5 % point over drivers), 95 % intervals over episodes"
    show_table(title, (found.by, "drivers", "km", *_MEASURES.values()), rows)
    rows = [
        [one.style, f"{one.rates['ttc_conflicts'].effective_drivers:.0f}", *(_rate(one.rates[name]) for name in _RATES)]
        for one in found.rows
    ]
    title = "Per 1,000 km, with Poisson intervals (events); a population's row is weighted by importance"
    show_table(title, (found.by, "effective drivers", *_RATES.values()), rows)
    show_table("How collisions came about", ("what", "n"), list(found.counts.items()))


def criticality(
    corpus: Path = typer.Argument(help="A corpus, simulated or recorded."),
    by: By = typer.Option(By.commanded, help="Sort drivers by commanded style, or by the class of track labels."),
    as_population: str | None = typer.Option(
        None, help="Add a row that weighs the drivers as this population has them, e.g. naturalistic for rare_heavy."
    ),
    out: Path | None = typer.Option(None, "--out", help="Write every figure as JSON to this file."),
    seed: int = typer.Option(0, min=0, help="Of the bootstrap of the intervals."),
) -> None:
    """Time to collision, headway, required deceleration, post-encroachment time and collisions, by style."""
    from stylesim.corpus import Corpus
    from stylesim.evaluation.criticality import criticality as run

    check_endings(out)
    opened = Corpus(corpus)
    with progress_bar("measuring encounters", "scenes") as progress:
        found = run(opened, as_population=as_population, by=by.value, seed=seed, progress=progress)
    show_criticality(found)
    write_figures(out, found.to_dict())


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command("criticality", epilog="Example: `stylesim criticality runs/rare --as-population naturalistic`")(
        criticality
    )
