"""From the `population`, `styles` and `scenario` that a user gives to what is simulated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stylesim.errors import InputError, unknown
from stylesim.population import Population
from stylesim.scenario import Scenario, load_scenario, scenarios

RESET_OPTIONS = ("population", "styles", "scenario")


@dataclass(frozen=True)
class Crowd:
    """Who drives, and where."""

    population: Population
    scenario: Scenario

    def changed(self, options: Mapping[str, Any] | None, *, backend: str) -> Crowd:
        """This crowd with the options of a reset; InputError for an unknown key, name or share."""
        options = dict(options or {})
        for key in options:
            if key not in RESET_OPTIONS:
                raise unknown("reset option", str(key), RESET_OPTIONS)
        population, scenario = self.population, self.scenario
        if options.get("population") is not None or options.get("styles") is not None:
            population = resolved_population(options.get("population"), options.get("styles"))
        if options.get("scenario") is not None:
            scenario = resolved_scenario(options["scenario"], backend=backend)
        return Crowd(population, scenario)


def resolved_population(population: Any, styles: Any, *, default: str = "naturalistic") -> Population:
    """The population by name, path or object, or the one of the given shares (mapping or text).

    Whatever a user gives is taken and checked here: InputError for other types, unknown names, or both at once.
    """
    if styles is not None:
        if population is not None:
            raise InputError("give population or styles, not both; Population.reweighted changes single shares")
        if not isinstance(styles, str | Mapping):
            raise InputError(f"styles is a mapping of shares or a text, not {type(styles).__name__}")
        return Population.of(**(_parsed_shares(styles) if isinstance(styles, str) else dict(styles)))
    if isinstance(population, Population):
        return population
    if population is not None and not isinstance(population, str):
        raise InputError(f"population is a name, a path or a Population, not {type(population).__name__}")
    return Population.load(population or default)


def _parsed_shares(text: str) -> dict[str, float]:
    shares: dict[str, float] = {}
    for item in text.split(","):
        name, equals, number = item.partition("=")
        try:
            shares[name.strip()] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"styles: {item!r} is not NAME=SHARE; write e.g. aggressive=0.3,careful=0.7")
    return shares


def place_of(scenario: Any) -> Scenario:
    """The scenario by name, path or object; InputError for anything else."""
    if isinstance(scenario, str):
        scenario = load_scenario(scenario)
    if not isinstance(scenario, Scenario):
        raise InputError(f"scenario is a name, a path or a Scenario, not {type(scenario).__name__}")
    return scenario


def resolved_scenario(scenario: Any, *, backend: str) -> Scenario:
    """The scenario by name, path or object; InputError if it runs in another simulator than `backend`."""
    scenario = place_of(scenario)
    if scenario.backend != backend:
        fitting = [name for name in scenarios() if load_scenario(name).backend == backend]
        raise InputError(
            f"scenario {scenario.name!r} runs in {scenario.backend!r}, this environment in {backend!r}. "
            f"Known: {', '.join(fitting) or 'none'}."
        )
    return scenario
