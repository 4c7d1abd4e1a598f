"""The table of styles in `agents/styles.yaml`, and the driver at any place of the knob."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from pydantic import Field

from stylesim.errors import InputError
from stylesim.resources import agents_dir
from stylesim.specs import Spec, load_yaml
from stylesim.style import CLASS_KNOB, PHYSICAL_FIELDS, DriverStyle, class_of_knob

DECIMALS = 4  # of a drawn parameter: finer than anything that a driver could mean, and it stores in half the bytes


class StyleParameter(Spec):
    """One driver parameter over the knob: values at the six classes and neutral, with unit and source."""

    unit: str
    source: str = Field(min_length=3)
    neutral: float
    aggressive: float
    reckless: float
    threatening: float
    careful: float
    cautious: float
    timid: float
    spread: float = Field(default=0.0, ge=0.0, le=0.5)  # sd of the log factor between drivers of one style
    low: float = 0.0  # hard limits of what a driver may be given
    high: float = Field(default=float("inf"))


class StyleTable(Spec):
    """The whole of `agents/styles.yaml`."""

    about: str
    parameters: dict[str, StyleParameter]

    def at(self, aggressiveness: float, rng: np.random.Generator | None = None) -> DriverStyle:
        """The driver at that place of the knob, by linear interpolation between the classes and neutral.

        With `rng`, each parameter is multiplied by a log-normal factor of its `spread` (people of one style
        differ), then clipped to its limits. ValueError outside [-1, 1].
        """
        name = class_of_knob(aggressiveness)
        knots = sorted([*((place, cls) for cls, place in CLASS_KNOB.items()), (0.0, "neutral")])
        places = [place for place, _ in knots]
        values: dict[str, float] = {}
        for key in PHYSICAL_FIELDS:
            parameter = self.parameters[key]
            value = float(np.interp(aggressiveness, places, [getattr(parameter, cls) for _, cls in knots]))
            if rng is not None:
                factor = float(np.exp(parameter.spread * np.clip(rng.standard_normal(), -2.0, 2.0)))
                value = round(float(np.clip(value * factor, parameter.low, parameter.high)), DECIMALS)
            values[key] = value
        return DriverStyle(name=name, aggressiveness=float(aggressiveness), **values)


@lru_cache(maxsize=8)
def _load(path: Path) -> StyleTable:
    table = load_yaml(StyleTable, path)
    for missing in sorted(set(PHYSICAL_FIELDS) - set(table.parameters)):
        raise InputError(f"{path}: parameter {missing!r} is missing")
    for extra in sorted(set(table.parameters) - set(PHYSICAL_FIELDS)):
        raise InputError(f"{path}: {extra!r} is no driver parameter; known: {', '.join(PHYSICAL_FIELDS)}")
    return table


def style_table(path: Path | None = None) -> StyleTable:
    """The table at `path`, by default the shipped `agents/styles.yaml`; InputError if it does not fit."""
    return _load(path or agents_dir() / "styles.yaml")
