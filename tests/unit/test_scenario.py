from __future__ import annotations

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.scenario import load_scenario, scenarios

TEXT = """
name: made
backend: sumo
title: a title
about: about
duration_s: 60
parameters:
  speed: {unit: m/s, source: chosen, low: 10, high: 20}
  lanes: {unit: "1", source: chosen, choices: [2, 3]}
"""


def write(tmp_path, text):
    (tmp_path / "scenario.yaml").write_text(text)
    return str(tmp_path)


def test_parameters_are_drawn_within_their_range(tmp_path):
    scenario = load_scenario(write(tmp_path, TEXT))
    drawn = [scenario.draw(np.random.default_rng(i)) for i in range(50)]
    assert {d["lanes"] for d in drawn} == {2.0, 3.0}
    assert all(10 <= d["speed"] <= 20 for d in drawn)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("duration_s: 60", "durations: 60"), "did you mean 'duration_s'"),
        (("duration_s: 60", "duration_s: -1"), "greater than 0"),
        (("low: 10, high: 20", "low: 10"), "give either low and high, or choices"),
        (("low: 10, high: 20", "low: 30, high: 20"), "is above high"),
        (("backend: sumo", "backend: carla"), "'sumo' or 'highway'"),
        (("source: chosen, low", "low"), "source"),
    ],
)
def test_a_bad_scenario_names_file_and_field(tmp_path, change, says):
    with pytest.raises(InputError, match=says) as error:
        load_scenario(write(tmp_path, TEXT.replace(*change)))
    assert "scenario.yaml" in str(error.value)


def test_unknown_scenarios_name_the_nearest_one():
    with pytest.raises(InputError, match="unknown scenario"):
        load_scenario("no_such_scenario")


def test_shipped_scenarios_load():
    for name in scenarios():
        assert load_scenario(name).name == name
