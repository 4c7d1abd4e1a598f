from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.evaluation.conformal import conformal, conformal_radius
from tests.unit.evaluation import small_world
from tests.unit.evaluation.small_world import ConstantVelocity


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 80), st.sampled_from([0.05, 0.1, 0.2, 0.5]))
def test_the_radius_covers_the_next_driver_as_often_as_promised(n: int, alpha: float) -> None:
    """Of n + 1 exchangeable scores each is the last with equal chance: count how often the others' radius holds it."""
    scores = np.random.default_rng(n).random(n + 1)
    held = [scores[i] <= conformal_radius(np.delete(scores, i), alpha) for i in range(n + 1)]
    assert np.mean(held) >= 1 - alpha - 1e-9
    assert np.mean(held) <= 1 - alpha + 1 / (n + 1) + 1e-9 or math.isinf(conformal_radius(scores[:n], alpha))


def test_too_few_scores_promise_nothing() -> None:
    assert math.isinf(conformal_radius(np.arange(8.0), 0.1))
    assert conformal_radius(np.arange(9.0), 0.1) == 8.0


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    path: Path = tmp_path_factory.mktemp("conformal") / "c"
    scenes = [small_world.scene(i, agents=12) for i in range(24)]
    with CorpusWriter(path, source="sumo", configuration={}, seed=7) as writer:
        for number, one in enumerate(scenes):
            writer.add(one, split="val" if number < 12 else "test")
        made = writer.finish()
    return made


def test_coverage_is_measured_on_other_drivers(corpus: Corpus) -> None:
    report = conformal(ConstantVelocity(), corpus, by="scenario", alpha=0.2, seed=3)
    everyone = report.regions[0]
    assert everyone.group == "all"
    assert everyone.calibration_drivers > 100
    assert everyone.coverage is not None
    assert everyone.coverage.low <= 0.85  # 0.8 was promised, no more was bought
    assert everyone.coverage.high >= 0.75
    assert {region.group for region in report.regions[1:]} == {"straight", "yellow_light"}
    assert report.to_dict()["regions"][0]["radius_m"] == everyone.radius_m
    again = conformal(ConstantVelocity(), corpus, by="scenario", alpha=0.2, seed=3)
    assert again.to_dict() == report.to_dict()


def test_a_small_group_gets_no_radius_of_its_own(corpus: Corpus) -> None:
    report = conformal(ConstantVelocity(), corpus, by="commanded*scenario", seed=3)
    small = [region for region in report.regions if 0 < region.calibration_drivers < 30]
    assert small
    assert all(math.isnan(region.radius_m) and region.coverage is None for region in small)


def test_what_cannot_be_judged_is_refused(corpus: Corpus) -> None:
    with pytest.raises(InputError, match="alpha"):
        conformal(ConstantVelocity(), corpus, by="scenario", alpha=1.0)
    with pytest.raises(InputError, match="cannot be judged on it"):
        conformal(ConstantVelocity(), corpus, by="scenario", calibrate_on="test")
    with pytest.raises(InputError, match="no tdbm labels"):
        conformal(ConstantVelocity(), corpus, by="history:tdbm")
