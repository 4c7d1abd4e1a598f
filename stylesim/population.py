"""`Population`: a mixture of styles that can be reweighted and drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from stylesim.errors import InputError, unknown
from stylesim.resources import agents_dir
from stylesim.specs import Spec, load_yaml
from stylesim.style import CLASS_INTERVAL, CLASS_KNOB, STYLE_CLASSES, DriverStyle
from stylesim.styles import load_calibration, style_table

SHARE_TOLERANCE = 1e-6


class PopulationSpec(Spec):
    """The file form, `agents/<name>.yaml`."""

    about: str
    source: str = Field(min_length=3)
    shares: dict[str, float]
    within_class: Literal["interval", "centre", "neutral", "placebo"] = "interval"


def check_shares(shares: Mapping[str, float], *, where: str) -> dict[str, float]:
    """All six shares in class order; InputError if a class is unknown, a share is negative, or the sum is not 1."""
    for name, share in shares.items():
        if name not in STYLE_CLASSES:
            raise unknown("style", name, STYLE_CLASSES, where=where)
        if not (np.isfinite(share) and share >= 0):
            raise InputError(f"{where}: the share of {name!r} is {share}; it must be a number >= 0")
    total = float(sum(shares.values()))
    if abs(total - 1.0) > SHARE_TOLERANCE:
        raise InputError(f"{where}: the shares sum to {total:.6g}, not 1; change them or use --reweight")
    return {name: float(shares.get(name, 0.0)) for name in STYLE_CLASSES}


@dataclass(frozen=True)
class Population:
    """Shares of the six classes; within a class the knob is drawn from its whole interval (or its centre).

    `within_class="neutral"` puts everybody at knob 0 (the reference that scalers are fitted on), whatever the shares.
    "placebo" does so too but draws a class for each: a world in which the commanded style has no effect.
    `calibration` is a file of `stylesim calibrate` to drive by, in place of what ships for the backend.
    """

    name: str
    shares: tuple[float, ...]
    within_class: str = "interval"
    about: str = ""
    source: str = ""
    calibration: str = ""

    def __post_init__(self) -> None:
        """Check the shares."""
        if len(self.shares) != len(STYLE_CLASSES):
            raise ValueError(f"shares needs {len(STYLE_CLASSES)} numbers, not {len(self.shares)}")
        check_shares(self.by_class, where=f"population {self.name!r}")

    @property
    def by_class(self) -> dict[str, float]:
        """Share of each class."""
        return dict(zip(STYLE_CLASSES, self.shares, strict=True))

    @classmethod
    def load(cls, name: str) -> Population:
        """A shipped population by name, or a YAML file by path. InputError if there is none."""
        if name.endswith((".yaml", ".yml")):
            path = Path(name)
            label = path.stem
        else:
            if name not in populations():
                raise unknown("population", name, populations())
            path, label = agents_dir() / f"{name}.yaml", name
        spec = load_yaml(PopulationSpec, path)
        shares = check_shares(spec.shares, where=str(path))
        return cls(label, tuple(shares.values()), spec.within_class, spec.about, spec.source)

    @classmethod
    def of(cls, **shares: float) -> Population:
        """A population of the given shares, which must sum to 1."""
        checked = check_shares(shares, where="styles")
        label = ",".join(f"{name}={share:g}" for name, share in checked.items() if share)
        return cls(label, tuple(checked.values()), source="given by the user")

    def reweighted(self, **shares: float) -> Population:
        """This population with the named shares set and the rest scaled to fill what is left."""
        for name, share in shares.items():
            if name not in STYLE_CLASSES:
                raise unknown("style", name, STYLE_CLASSES, where="reweight")
            if not 0.0 <= share <= 1.0:
                raise InputError(f"reweight: the share of {name!r} must lie in [0, 1], not {share}")
        left = 1.0 - sum(shares.values())
        rest = sum(share for name, share in self.by_class.items() if name not in shares)
        if left < -SHARE_TOLERANCE:
            raise InputError(f"reweight: the given shares sum to {1 - left:.6g}, more than 1")
        if rest <= 0 and left > SHARE_TOLERANCE:
            raise InputError("reweight: nothing is left to scale; give shares that sum to 1")
        scale = max(left, 0.0) / rest if rest > 0 else 0.0
        merged = {name: shares.get(name, share * scale) for name, share in self.by_class.items()}
        changed = ",".join(f"{name}={share:g}" for name, share in shares.items())
        return replace(self, name=f"{self.name}+{changed}", shares=tuple(merged.values()))

    def calibrated(self, path: str | Path) -> Population:
        """This population, driving by the calibration in that file. InputError if it does not fit."""
        load_calibration(Path(path).absolute())
        return replace(self, calibration=str(Path(path).absolute()))

    def draw(self, rng: np.random.Generator, *, backend: str = "", limit_mps: float | None = None) -> DriverStyle:
        """One driver: class by share, place on the knob within the class, then individual variation.

        `backend` chooses the calibrated parameters, the limit of the road that it enters by those of that kind of road.
        """
        table = style_table(backend, calibration=Path(self.calibration) if self.calibration else None)
        if self.within_class == "neutral":
            return replace(table.at(0.0, rng), name="neutral")
        name = STYLE_CLASSES[int(rng.choice(len(self.shares), p=np.array(self.shares) / sum(self.shares)))]
        if self.within_class == "placebo":
            return replace(table.at(0.0, rng), name=name)
        low, high = CLASS_INTERVAL[name]
        knob = CLASS_KNOB[name] if self.within_class == "centre" else float(rng.uniform(low, high))
        return table.at(knob, rng, limit_mps=limit_mps)


def populations() -> tuple[str, ...]:
    """Names of the shipped populations."""
    return tuple(sorted(p.stem for p in agents_dir().glob("*.yaml") if p.stem.split(".")[0] != "styles"))
