"""`list`, `describe`: what there is."""

from __future__ import annotations

from enum import StrEnum

import typer

from stylesim.cli.console import say, show_table
from stylesim.errors import unknown
from stylesim.population import Population, populations
from stylesim.scenario import Scenario, load_scenario, scenarios
from stylesim.style import CLASS_INTERVAL, PHYSICAL_FIELDS, STYLE_CLASSES
from stylesim.styles import style_table


class What(StrEnum):
    """What `stylesim list` can list."""

    scenarios = "scenarios"
    populations = "populations"
    styles = "styles"
    datasets = "datasets"


def list_(what: What | None = typer.Argument(None, help="What to list; without it all four.")) -> None:
    """List scenarios, populations, styles or data-set formats."""
    for one in What if what is None else (what,):
        _show(one)


def _show(what: What) -> None:
    if what is What.scenarios:
        listed = [(s.name, s.backend, f"{s.duration_s:g}", s.title) for s in map(load_scenario, scenarios())]
        show_table("Scenarios", ("name", "backend", "seconds", "what it is"), listed)
    elif what is What.populations:
        loaded = [Population.load(name) for name in populations()]
        shares = [[p.name, *(f"{share:.2f}" for share in p.shares)] for p in loaded]
        show_table("Populations: share of each style", ("name", *STYLE_CLASSES), shares)
    elif what is What.styles:
        table = style_table()
        parameters = [
            [key, *(f"{getattr(table.parameters[key], c):g}" for c in STYLE_CLASSES)] for key in PHYSICAL_FIELDS
        ]
        show_table("Styles: parameters at the place of each class", ("parameter", *STYLE_CLASSES), parameters)
    else:
        datasets()


def datasets() -> None:
    """Every data set that can be read: its files, rate, map, signals, licence, and where to get it."""
    from stylesim.datasets.formats import FORMATS

    columns = ("name", "what it is", "files", "Hz", "map", "signals", "licence of the data", "from", "tested on")
    rows = [
        (
            f.name,
            f.description,
            f.supports,
            f"{f.rate_hz:g}",
            _yes(f.has_map),
            _yes(f.has_signals),
            f.licence,
            f.where,
            f.tested_on,
        )
        for f in FORMATS.values()
    ]
    show_table("Data sets that `stylesim read` knows", columns, rows)


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _describe_scenario(scenario: Scenario) -> None:
    say(f"{scenario.name} ({scenario.backend}): {scenario.title}\n{scenario.about.strip()}")
    say(f"An episode logs {scenario.duration_s:g} s after {scenario.warm_up_s:g} s of warm-up.")
    rows = []
    for name, p in sorted(scenario.parameters.items()):
        span = " | ".join(f"{c:g}" for c in p.choices) if p.choices else f"{p.low:g} .. {p.high:g}"
        rows.append((name, span, p.unit, p.source))
    show_table("Drawn per episode", ("parameter", "values", "unit", "source"), rows)


def _describe_style(name: str) -> None:
    low, high = CLASS_INTERVAL[name]
    say(f"{name}: knob (aggressiveness) from {low:g} to {high:g}")
    table = style_table().parameters
    rows = [
        (key, f"{getattr(table[key], name):g}", table[key].unit, f"{table[key].spread:g}", table[key].source)
        for key in PHYSICAL_FIELDS
    ]
    show_table("Parameters at its centre", ("parameter", "value", "unit", "spread", "source"), rows)


def describe(name: str = typer.Argument(help="A scenario, population, style or data-set format.")) -> None:
    """Describe a scenario, population, style or data-set format."""
    from stylesim.datasets.formats import FORMATS

    if name in scenarios():
        _describe_scenario(load_scenario(name))
    elif name in populations():
        population = Population.load(name)
        say(f"{name}: {population.about.strip()}\nSource of the shares: {population.source.strip()}")
        show_table("Shares", ("style", "share"), [(k, f"{v:.3f}") for k, v in population.by_class.items()])
    elif name in STYLE_CLASSES:
        _describe_style(name)
    elif name in FORMATS:
        f = FORMATS[name]
        say(f"{f.name}: {f.description}\nfiles: {f.supports}\nrate: {f.rate_hz:g} Hz")
        say(f"map: {_yes(f.has_map)}\nsignals: {_yes(f.has_signals)}")
        say(f"options (-o KEY=VALUE): {', '.join(f.options) or 'none'}\nlicence: {f.licence}\nfrom: {f.where}")
        say(f"tested on: {f.tested_on}")
    else:
        known = [*scenarios(), *populations(), *STYLE_CLASSES, *FORMATS]
        raise unknown("name", name, known)


def add_to(app: typer.Typer) -> None:
    """Register the verbs."""
    app.command("list", epilog="Example: `stylesim list scenarios`")(list_)
    app.command("datasets", epilog="Then: `stylesim read auto PATH --out runs/real`")(datasets)
    app.command("describe", epilog="Example: `stylesim describe yellow_light`")(describe)
