"""Drivers who meet the onset at a drawn time, and what they do there in SUMO."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.evaluation.approaches import Approaches, yellow_approaches
from stylesim.population import Population
from stylesim.scenario import Scenario, load_scenario
from stylesim.simulation.sumo.episode import prepare_episode

pytest.importorskip("libsumo", exc_type=ImportError)
from stylesim.simulation.sumo import SumoBackend

ROOT = Path(__file__).resolve().parents[3]
NEUTRAL = Population.load("neutral")


def dilemma(**options: object) -> Scenario:
    scenario = load_scenario(str(ROOT / "benchmarks" / "dilemma"))
    short = scenario.model_copy(update={"duration_s": 150.0})
    return short.model_copy(update={"options": {**short.options, **options}})


@pytest.fixture(scope="module")
def found() -> Iterator[tuple[Approaches, dict[str, int]]]:
    backend = SumoBackend()
    scene = backend.run_episode(dilemma(), NEUTRAL, seed=2, episode=0)
    speed = scene.tracks.speed_mps
    both = scene.tracks.valid[:, 1:] & scene.tracks.valid[:, :-1]
    hardest = round(-10 * float((np.diff(speed, axis=1) / 0.1)[both].min()))
    yield yellow_approaches([scene]), {**scene.counts, "hardest": hardest}
    backend.close()


def test_everybody_meets_the_onset_alone_within_the_drawn_times(found: tuple[Approaches, dict[str, int]]) -> None:
    approaches, counts = found
    assert len(approaches) == counts["drivers"] >= 32 * 3
    assert approaches.free.all()
    assert approaches.tts_s.min() > 0.8
    assert approaches.tts_s.max() < 6.4
    assert np.ptp(approaches.tts_s) > 4.0


def test_what_was_decided_is_done(found: tuple[Approaches, dict[str, int]]) -> None:
    approaches, counts = found
    assert counts["collisions"] == 0
    assert 0.3 < approaches.stopped.mean() < 0.85
    differs = (approaches.decided == 1) != approaches.stopped
    assert differs.sum() <= counts["gave_up_at_red"] + 1
    assert counts["hardest"] <= 80  # tenths of m/s2


def test_a_road_that_is_too_short_is_named(tmp_path: Path) -> None:
    flows = [{"name": "a", "enter": "a_in", "onset_tts_s": [1.0, 60.0], "to": {"a_out": 1.0}}]
    with pytest.raises(InputError, match=r"'a_in' of \d+ m is too short"):
        prepare_episode(dilemma(flows=flows), NEUTRAL, seed=2, episode=0, folder=tmp_path)


@pytest.mark.parametrize(
    ("flow", "said"),
    [
        ({"share": 1.0, "onset_tts_s": [1.0, 2.0]}, "either share or onset_tts_s"),
        ({"onset_tts_s": [2.0, 1.0]}, "rising"),
        ({}, "either share or onset_tts_s"),
    ],
)
def test_a_flow_has_one_kind_of_arrivals(flow: dict[str, object], said: str, tmp_path: Path) -> None:
    flows = [{"name": "a", "enter": "a_in", "to": {"a_out": 1.0}, **flow}]
    with pytest.raises(InputError, match=said):
        prepare_episode(dilemma(flows=flows), NEUTRAL, seed=2, episode=0, folder=tmp_path)
