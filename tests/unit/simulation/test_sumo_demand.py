"""Who drives a truck."""

from __future__ import annotations

import pytest

from stylesim.population import Population
from stylesim.simulation.sumo.demand import MOST_TRUCKS, STYLES_OF_SLOW_TRUCKS, truck_chance
from stylesim.simulation.sumo.vehicles import TRUCK_TOP_SPEED_MPS
from stylesim.style import CLASS_KNOB, STYLE_CLASSES
from stylesim.styles import style_table

CROWD = Population.load("tdbm_spectrum")
STYLES = {name: style_table().at(CLASS_KNOB[name]) for name in STYLE_CLASSES}


def chances(population: Population, limit_mps: float | None, share: float = 0.06) -> dict[str, float]:
    return {name: truck_chance(style, population, share=share, limit_mps=limit_mps) for name, style in STYLES.items()}


def test_on_a_motorway_the_slow_styles_drive_the_trucks_and_their_share_stays():
    found = chances(CROWD, 36.0)
    assert {name for name, chance in found.items() if chance > 0} == set(STYLES_OF_SLOW_TRUCKS)
    assert sum(CROWD.by_class[name] * chance for name, chance in found.items()) == pytest.approx(0.06)


@pytest.mark.parametrize("limit_mps", [None, 16.7, TRUCK_TOP_SPEED_MPS])
def test_where_the_limiter_does_not_matter_anybody_drives_one(limit_mps: float | None):
    assert set(chances(CROWD, limit_mps).values()) == {0.06}


def test_neutral_drivers_all_drive_them():
    assert set(chances(Population.load("neutral"), 36.0).values()) == {0.06}


def test_a_population_of_bold_drivers_has_no_more_trucks_than_its_slow_ones_can_drive():
    few = chances(Population.of(aggressive=0.95, careful=0.05), 36.0)
    assert few["careful"] == MOST_TRUCKS
    assert few["aggressive"] == 0.0
