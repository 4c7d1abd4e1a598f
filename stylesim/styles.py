"""The table of styles in `agents/styles.yaml`, what was calibrated of it per simulator, and the driver at any knob.

`agents/styles.yaml` knows no simulator: neutral anchors, limits, units, sources, and hand-made places of the classes.
`agents/styles.<backend>.yaml`, where it is shipped, lies over it: parameters that `stylesim calibrate` found for that
simulator and kind of road, for each class the value at the calm and the bold end of its stretch of the knob.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from stylesim.errors import InputError, unknown
from stylesim.resources import agents_dir
from stylesim.specs import Spec, load_yaml
from stylesim.style import CLASS_INTERVAL, CLASS_KNOB, PHYSICAL_FIELDS, STYLE_CLASSES, DriverStyle, class_of_knob

MOTORWAY, OTHER = "motorway", "other"  # kinds of road: people drive differently where they cannot meet a junction
MOTORWAY_LIMIT_MPS = 80 / 3.6  # REFERENCE section 1: a highway has a limit of 80 km/h or more [ours]
LIMIT_TOLERANCE_MPS = 0.05  # limits are stored as float32 and some maps round to 0.1 m/s
COMFORT = "comfortable_speed_mps"  # only in calibrations: drivers who do not go faster, however high the limit
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


class ClassRange(Spec):
    """One parameter of one class: from the calm to the bold end of its stretch of the knob, and around that line."""

    calm: float
    bold: float
    spread: float = Field(default=0.0, ge=0.0, le=0.5)  # sd of the log factor between drivers at one place of the knob

    def at(self, aggressiveness: float, name: str) -> float:
        """The value at that place of the knob, within the stretch of the class `name`."""
        return float(np.interp(aggressiveness, CLASS_INTERVAL[name], (self.calm, self.bold)))


Ranges = dict[str, dict[str, ClassRange]]  # parameter -> class -> range


class StyleTable(Spec):
    """The whole of `agents/styles.yaml`, and what lies over it on each kind of road."""

    about: str
    parameters: dict[str, StyleParameter]
    calibrated: dict[str, Ranges] = Field(default_factory=dict)  # by kind of road

    def at(
        self, aggressiveness: float, rng: np.random.Generator | None = None, *, limit_mps: float | None = None
    ) -> DriverStyle:
        """The driver at that place of the knob, entering by a road of that limit; 0 is the neutral one.

        Where nothing is calibrated for that kind of road, a parameter is interpolated linearly between the classes and
        neutral; where something is, between the two ends of the class's own range. With `rng`, each parameter is
        multiplied by a log-normal factor of its spread (people of one style differ), then clipped to its limits.
        The wished speed is no higher than the class's comfortable one, whatever the limit. ValueError outside [-1, 1].
        """
        name = class_of_knob(aggressiveness)
        ranges = self.calibrated.get(road_kind(limit_mps), {}) if aggressiveness != 0.0 else {}
        values: dict[str, float] = {}
        for key in PHYSICAL_FIELDS:
            parameter = self.parameters[key]
            if key in ranges:
                own = ranges[key][name]
                value, spread = own.at(aggressiveness, name), own.spread
                if key == "desired_speed_factor" and limit_mps is not None and COMFORT in ranges:
                    value = min(value, ranges[COMFORT][name].at(aggressiveness, name) / limit_mps)
            else:
                value, spread = _between_classes(parameter, aggressiveness), parameter.spread
            if rng is not None:
                factor = float(np.exp(spread * np.clip(rng.standard_normal(), -2.0, 2.0)))
                value = round(float(np.clip(value * factor, parameter.low, parameter.high)), DECIMALS)
            values[key] = value
        return DriverStyle(name=name, aggressiveness=float(aggressiveness), **values)


def _between_classes(parameter: StyleParameter, aggressiveness: float) -> float:
    knots = sorted([*((place, cls) for cls, place in CLASS_KNOB.items()), (0.0, "neutral")])
    return float(
        np.interp(aggressiveness, [place for place, _ in knots], [getattr(parameter, cls) for _, cls in knots])
    )


class Calibration(Spec):
    """The whole of `agents/styles.<backend>.yaml`."""

    about: str
    backend: str
    roads: dict[Literal["motorway", "other"], Ranges]
    provenance: dict[str, Any] = Field(default_factory=dict)


def road_kind(speed_limit_mps: float | None) -> str:
    """The kind of road that a driver enters by, from its limit; without one it is no motorway."""
    fast = speed_limit_mps is not None and speed_limit_mps >= MOTORWAY_LIMIT_MPS - LIMIT_TOLERANCE_MPS
    return MOTORWAY if fast else OTHER


def calibration_file(backend: str) -> Path | None:
    """What ships for that backend, or None."""
    path = agents_dir() / f"styles.{backend}.yaml"
    return path if backend and path.is_file() else None


@lru_cache(maxsize=8)
def load_calibration(path: Path) -> Calibration:
    """A calibration from its file; InputError if it does not fit."""
    found = load_yaml(Calibration, path)
    for road, ranges in found.roads.items():
        for key, classes in ranges.items():
            if key not in (*PHYSICAL_FIELDS, COMFORT):
                raise unknown("driver parameter", key, (*PHYSICAL_FIELDS, COMFORT), where=path)
            if set(classes) != set(STYLE_CLASSES):
                raise InputError(f"{path}: roads.{road}.{key} must name each of {', '.join(STYLE_CLASSES)}")
    return found


@lru_cache(maxsize=8)
def _load(path: Path) -> StyleTable:
    table = load_yaml(StyleTable, path)
    for missing in sorted(set(PHYSICAL_FIELDS) - set(table.parameters)):
        raise InputError(f"{path}: parameter {missing!r} is missing")
    for extra in sorted(set(table.parameters) - set(PHYSICAL_FIELDS)):
        raise InputError(f"{path}: {extra!r} is no driver parameter; known: {', '.join(PHYSICAL_FIELDS)}")
    return table


@lru_cache(maxsize=16)
def _over(base: Path, calibration: Path) -> StyleTable:
    return _load(base).model_copy(update={"calibrated": load_calibration(calibration).roads})


def style_table(backend: str = "", *, calibration: Path | None = None) -> StyleTable:
    """The shipped table, under what was calibrated for `backend` (where that ships) or is in the file `calibration`.

    InputError if a file does not fit, or was calibrated for another backend.
    """
    base = agents_dir() / "styles.yaml"
    over = calibration or calibration_file(backend)
    if over is None:
        return _load(base)
    made_for = load_calibration(over).backend
    if backend and made_for != backend:
        raise InputError(f"{over} was calibrated for {made_for!r}; it says nothing of {backend!r}")
    return _over(base, over)
