"""`export`: what others can read; one sub-command for each foreign format."""

from __future__ import annotations

from pathlib import Path

import typer

from stylesim.cli.console import progress_bar, say, show_table
from stylesim.cli.generating import chosen_population

exports = typer.Typer(
    name="export",
    help="Write what other programs read: data sets for their frameworks, vehicle types for SUMO.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)


def sumo_vtypes(
    population: str = typer.Argument(help="A population's name (see `stylesim list populations`) or YAML file."),
    out: Path = typer.Option(..., "--out", help="The new file; must not exist."),
    reweight: str | None = typer.Option(None, help="Set some shares, scale the rest: aggressive=0.3."),
    types: int = typer.Option(120, min=6, help="How many drivers the file holds."),
    truck_share: float = typer.Option(0.0, min=0.0, max=1.0, help="Share of trucks among them."),
    seed: int = typer.Option(0, min=0, help="Same seed, same bytes."),
) -> None:
    """Write a vTypeDistribution with drivers of a population, for the plain `sumo` program.

    The file says at its head what it cannot carry: decisions at the yellow, wander, the log.
    """
    from stylesim.plugins.vtypes import distribution_id, export_vtypes

    crowd = chosen_population(population, None, reweight)
    path = export_vtypes(crowd, out, types=types, truck_share=truck_share, seed=seed)
    say(f'{path}: load it with `sumo … -a {path}` and give your vehicles type="{distribution_id(crowd)}"')


exports.command("sumo-vtypes", epilog="Example: `stylesim export sumo-vtypes rare_heavy --out styles.add.xml`")(
    sumo_vtypes
)


def _data_command(format_name: str, about: str, reads: str) -> None:
    """The sub-command that writes a corpus in that format."""

    def command(
        corpus: Path = typer.Argument(help="A corpus."),
        out: Path = typer.Option(..., "--out", help="The new folder; must not exist."),
        labels: str = typer.Option("", help="Styles to write along: tdbm, kdsc, commanded; comma-separated."),
        split: str | None = typer.Option(None, help="Only that split: train, val or test."),
    ) -> None:
        from stylesim.corpus import Corpus
        from stylesim.exporting import export

        asked = [name.strip() for name in labels.split(",") if name.strip()]
        with progress_bar(f"writing {format_name}", "scenes") as progress:
            counts = export(format_name, Corpus(corpus), out=out, labels=asked, split=split, progress=progress)
        show_table("Counted", ("what", "n"), list(counts.items()))
        say(f"{out}")

    command.__doc__ = f"Write {about} (read by {reads}); what the format cannot carry is counted."
    example = f"Example: `stylesim export {format_name} runs/mixed --labels tdbm --out runs/{format_name}`"
    exports.command(format_name, epilog=example)(command)


for _name, _about, _reads in (
    ("av2", "Argoverse 2 scenarios with maps", "av2, UniTraj"),
    ("scenarionet", "a ScenarioNet database", "MetaDrive, UniTraj"),
    ("womd", "Waymo Scenario records", "Waymax"),
    ("gpudrive", "GPUDrive JSON", "GPUDrive"),
    ("commonroad", "CommonRoad XML", "commonroad-io"),
    ("levelx", "CSV triples as of inD and rounD", "tools for highD's family"),
):
    _data_command(_name, _about, _reads)


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.add_typer(exports)
