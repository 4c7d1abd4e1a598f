"""Figures of two stress tests that no driver pairs: each with its own interval, beside each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from stylesim.evaluation.intervals import Estimate
from stylesim.evaluation.slices import ALL


@dataclass(frozen=True)
class Figure:
    """One figure of both; None where one has none (a forecaster of one mode has no calibration)."""

    group: str
    name: str
    ours: Estimate | None
    theirs: Estimate | None
    better: str  # "less", "more", or a value that it should have

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        sides = {
            side: None if value is None else value.to_dict()
            for side, value in (("ours", self.ours), ("theirs", self.theirs))
        }
        return {"group": self.group, "name": self.name, "better": self.better, **sides}


def figures_beside(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> tuple[Figure, ...]:
    """What both `.stress.json` say of the worst group, rare drivers, calibration, coverage and twins."""
    a, b = (dict(_figures(raw)) for raw in (ours, theirs))
    return tuple(Figure(*key[:2], a.get(key), b.get(key), key[2]) for key in dict.fromkeys([*a, *b]))


def _figures(raw: Mapping[str, Any]) -> Iterator[tuple[tuple[str, str, str], Estimate]]:
    if raw["worst_group"] is not None:
        worst = raw["worst_group"]
        yield ("worst group", "minFDE of the worst style × scenario (m)", "less"), _of(worst["min_fde_m"])
        yield ("worst group", "above the average (m)", "less"), _of(worst["gap_to_average_m"])
    for one in raw["degradation"]:
        if one["scenario"] == ALL:
            yield ("rare drivers", "minFDE, rare_heavy minus naturalistic (m)", "less"), _of(one["change"]["min_fde_m"])
    for one in raw["reliability"]:
        name = f"expected calibration error, {one['group']}"
        yield ("calibration", name, "less"), _of(one["expected_calibration_error"])
    for one in raw["coverage"]:
        sides = f"{one['calibrated_on']} on {one['judged_on']}"
        for region in one["regions"]:
            if one["by"] == "commanded" and one["calibrated_on"] != one["judged_on"]:
                name = f"coverage of one radius, {sides}, {region['group']}"
                yield ("coverage", name, f"{1 - one['alpha']:g}"), _of(region["pooled_coverage"])
    yield from _twins(raw)


def _twins(raw: Mapping[str, Any]) -> Iterator[tuple[tuple[str, str, str], Estimate]]:
    if raw["twins"] is not None:
        figures = raw["twins"]["figures"]
        yield ("twins", "both futures covered", "more"), _of(figures["covers_both"])
        yield ("twins", "energy score of the mixture (m)", "less"), _of(raw["twins"]["mixture"]["twin"]["score_m"])
        over = raw["twins"]["mixture"]["twin"]["over_best_m"]
        yield ("twins", "above the best probabilities (m)", "less"), _of(over)
    if raw["twins_from_start"] is not None:
        for pair, what in (("twin", "another style"), ("null", "null")):
            figures = raw["twins_from_start"]["figures"][pair]
            yield ("twins from the start", f"{what}: the same way", "more"), _of(figures["agrees"])
            yield ("twins from the start", f"{what}: share of the difference", "1"), _of(figures["share"])


def _of(raw: Mapping[str, Any]) -> Estimate:
    return Estimate.from_dict(dict(raw))
