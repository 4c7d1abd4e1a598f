from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.evaluation.seeded import SeededEstimate
from stylesim.experiments.placebo import Check, Placebo, check_worlds, placebo
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.style import STYLE_CLASSES
from tests.conftest import make_scene

from .world import SPEC, world


def change(low: float, high: float, *, level: float = 0.9, status: str = "general") -> SeededEstimate:
    return SeededEstimate((low + high) / 2, low, high, level, 100, 10, 5, status)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("expects", "low", "high", "passed"),
    [
        ("nothing", -0.01, 0.01, True),
        ("nothing", -0.02, 0.01, False),  # includes 0, but nothing is shown
        ("nothing", -0.12, -0.10, False),  # a label that leaks
        ("gain", -0.12, -0.10, True),
        ("gain", -0.12, 0.001, False),
        ("no gain", 0.02, 0.30, True),  # told the wrong styles it may be worse
        ("no gain", -0.02, 0.30, False),
    ],
)
def test_what_passes(expects: str, low: float, high: float, passed: bool) -> None:
    check = Check("w", "a", "none", expects, change(low, high), 0.015)
    assert check.passed is passed
    assert Placebo((check,)).passed is passed and Placebo((check,)).to_dict()["passed"] is passed


def test_without_its_positive_control_nothing_is_shown() -> None:
    nothing = Check("placebo", "tdbm", "none", "nothing", change(-0.01, 0.01), 0.015)
    missed = Check("control", "oracle", "none", "gain", change(-0.01, 0.01), 0.015)
    assert nothing.passed and not Placebo((nothing, missed)).passed


def test_too_few_drivers_show_nothing() -> None:
    assert not Check("w", "a", "none", "nothing", change(np.nan, np.nan, status="too few"), 0.015).passed


def test_a_placebo_population_has_every_style_in_name_and_one_behaviour() -> None:
    crowd = Population.load("placebo")
    drivers = [crowd.draw(stream(1, 0, i, "style"), backend="sumo", limit_mps=30.0) for i in range(300)]
    assert {driver.name for driver in drivers} == set(STYLE_CLASSES)
    assert {driver.aggressiveness for driver in drivers} == {0.0}
    headway = {name: [d.time_headway_s for d in drivers if d.name == name] for name in STYLE_CLASSES}
    means = [float(np.mean(values)) for values in headway.values()]
    spread = float(np.std([d.time_headway_s for d in drivers]))
    assert max(means) - min(means) < spread  # six means of about 50 drivers each
    neutral = Population.load("neutral").draw(stream(1, 0, 0, "other"), backend="sumo")
    assert spread > 0.05 and abs(np.mean(means) - neutral.time_headway_s) < 1.0


def test_worlds_that_are_not_what_they_must_be(tmp_path: Path) -> None:
    styled = world(tmp_path / "styled", matters=True, train=1, val=1, test=1)
    with pytest.raises(InputError, match="is no placebo"):
        check_worlds(styled, styled)
    with pytest.raises(InputError, match="is no placebo"):
        placebo(styled, styled, seeds=(0,), steps=1, out=tmp_path / "out", spec=SPEC)
    assert not (tmp_path / "out").exists()
    with CorpusWriter(tmp_path / "recorded", source="made", configuration={}) as writer:
        scene = make_scene("s")
        writer.add(replace(scene, tracks=replace(scene.tracks, driver=())), split="test")
        recorded: Corpus = writer.finish()
    with pytest.raises(InputError, match="needs generated traffic"):
        check_worlds(recorded, styled)
