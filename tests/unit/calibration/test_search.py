from __future__ import annotations

import numpy as np
import pytest

from stylesim.calibration.behaviours import BEHAVIOURS, HIGH, LOW, WIDTH, start
from stylesim.calibration.knob import knob_laws
from stylesim.calibration.measuring import Trial
from stylesim.calibration.proposal import FIRST_SD, Law, first_proposal, proposal_of, ranges_of, updated
from stylesim.style import CLASS_KNOB, STYLE_CLASSES
from stylesim.styles import MOTORWAY, Calibration

WANDER = [b.name for b in BEHAVIOURS].index("lane_wander_m")


def trial(law: Law, *, n: int = 300, seed: int = 0, a_follows: float = 0.0) -> Trial:
    """Drivers drawn from a law, who measure as their class where they wander more than the law's middle."""
    rng = np.random.default_rng(seed)
    commanded = np.repeat(np.arange(6), n)
    behaviour = law.mean[commanded] + law.sd[commanded] * rng.standard_normal((6 * n, len(BEHAVIOURS)))
    margin = behaviour[:, WANDER] - law.mean[commanded, WANDER]
    knob = np.array([CLASS_KNOB[name] for name in STYLE_CLASSES])[commanded] + rng.uniform(-0.1, 0.1, 6 * n)
    return Trial(
        scenario=("made",) * (6 * n),
        road=(MOTORWAY,) * (6 * n),
        commanded=commanded,
        measured=np.where(margin > 0, commanded, (commanded + 1) % 6),
        knob=np.clip(knob, -1, 1),
        a=knob + a_follows * margin,
        margin=margin,
        behaviour=behaviour,
        collisions=0,
    )


def law() -> Law:
    middle = np.tile((LOW + HIGH) / 2, (6, 1))
    return Law(middle, np.full_like(middle, FIRST_SD))


def test_the_mean_moves_to_what_succeeds_and_nowhere_else():
    before = law()
    moved = (updated({MOTORWAY: before}, trial(before), sd=0.1)[MOTORWAY].mean - before.mean) / FIRST_SD
    assert (moved[:, WANDER] > 0.8).all()
    others = np.delete(moved, WANDER, axis=1)
    assert np.abs(others).max() < 0.4  # noise of 300 drivers: 1.5 / sqrt(300) = 0.09 each


def test_the_search_stays_within_human_limits():
    edge = Law(np.tile(HIGH, (6, 1)), np.full((6, len(BEHAVIOURS)), FIRST_SD))
    for _ in range(3):
        edge = updated({MOTORWAY: edge}, trial(edge), sd=0.1)[MOTORWAY]
    assert (edge.mean <= HIGH).all()
    assert (edge.sd == 0.1 * WIDTH).all()


def test_a_class_without_drivers_stays_where_it_was():
    before = law()
    few = trial(before, n=5)
    assert np.array_equal(updated({MOTORWAY: before}, few, sd=0.1)[MOTORWAY].mean, before.mean)


def test_laws_survive_the_file():
    proposal = first_proposal((MOTORWAY, "other"))
    document = Calibration.model_validate({"about": "x", "backend": "sumo", "roads": ranges_of(proposal)})
    again = proposal_of(document)
    for road in (MOTORWAY, "other"):
        assert again[road].mean == pytest.approx(proposal[road].mean, abs=2e-3)
        assert again[road].mean == pytest.approx(start(road), abs=2e-3)


def test_behaviours_that_explain_a_follow_the_knob():
    before = law()
    laws = knob_laws({MOTORWAY: before}, [trial(before, seed=k, a_follows=10.0) for k in range(3)])
    half = laws[MOTORWAY].half
    assert (half[:, WANDER] > 1.3 * FIRST_SD).all()  # sqrt(3) sds where it explains all
    table = ranges_of(laws)[MOTORWAY]["lane_wander_m"]["reckless"]
    assert table["calm"] < table["bold"]
    spread = np.sqrt(half**2 / 3 + laws[MOTORWAY].sd ** 2)
    assert spread == pytest.approx(before.sd)  # knob and rest together vary as the search did
