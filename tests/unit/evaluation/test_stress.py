from __future__ import annotations

import json

import numpy as np
import polars as pl
import pytest

from stylesim.errors import InputError
from stylesim.evaluation.evaluate import evaluate
from stylesim.evaluation.reliability import reliability
from stylesim.evaluation.stress import stress
from stylesim.evaluation.stress_corpora import EVERYDAY, RARE, StressTraffic, own_traffic
from stylesim.evaluation.stress_groups import degradation, worst_group
from stylesim.evaluation.stress_results import load_stress
from stylesim.evaluation.stress_windows import CAUSED, NO_EVENT, with_events


@pytest.fixture(scope="module")
def found(world, small_corpus):
    return stress(world.ConstantVelocity((1.0, 0.9)), own_traffic(small_corpus))


@pytest.fixture(scope="module")
def paired(world, tmp_path_factory):
    """Everyday: the world itself. Rare: the same episodes' successors, that is other draws of the same world."""
    folder = tmp_path_factory.mktemp("paired")
    corpora = [
        world.write(folder / name, [world.scene(e) for e in range(first, first + 20)], with_labels=False)
        for name, first in ((EVERYDAY, 0), (RARE, 20))
    ]
    return StressTraffic({EVERYDAY: (corpora[0],), RARE: (corpora[1],)}, ())


def table(rows: int, **columns: object) -> pl.DataFrame:
    """Windows of as many drivers, six to a unit, with every metric 1 unless given."""
    names = ("min_ade_m", "min_fde_m", "miss_rate", "brier_fde_m", "top_fde_m")
    base = {name: np.ones(rows) for name in names}
    who = {"unit_id": [f"u{i // 6}" for i in range(rows)], "agent_id": [f"a{i % 6}" for i in range(rows)]}
    return pl.DataFrame({**who, **base, **columns})


def test_accuracy_is_that_of_evaluate(world, small_corpus, found):
    plain = evaluate(world.ConstantVelocity((1.0, 0.9)), small_corpus, by=("commanded*scenario",))
    ours = {one.value: one.metrics["min_fde_m"].value for one in found.evaluation.slices_by("commanded*scenario")}
    theirs = {one.value: one.metrics["min_fde_m"].value for one in plain.slices_by("commanded*scenario")}
    assert ours == pytest.approx(theirs, nan_ok=True)
    assert found.evaluation.overall.size.n_drivers == 160


def test_without_two_populations_nothing_is_said_of_degradation(found):
    assert found.degradation == ()


def test_no_group_is_worst_among_refused_ones(found):
    assert all(one.size.refused for one in found.evaluation.slices_by("commanded*scenario"))
    assert found.worst is None


def test_the_gap_of_a_group_that_is_two_metres_worse():
    error = np.where(np.arange(120) % 6 < 3, 3.0, 1.0)
    style = np.where(np.arange(120) % 6 < 3, "reckless", "timid")
    windows = table(120, min_fde_m=error, commanded=style, scenario=["road"] * 120)
    from stylesim.evaluation.slices import cell

    cells = tuple(
        cell(windows.filter(pl.col("commanded") == s), by="commanded", value=s, seed=0, within_site=True)
        for s in ("reckless", "timid")
    )
    worst = worst_group(windows, cells, "commanded", seed=0)
    assert (worst.value, worst.among) == ("reckless", 2)
    assert worst.gap_m.value == pytest.approx(1.0)
    assert worst.ratio == pytest.approx(1.5)
    assert 0.5 < worst.gap_m.low <= 1.0 <= worst.gap_m.high < 1.5


def test_degradation_is_the_difference_within_scenarios():
    def side(population, errors, per_scenario):
        return pl.concat(
            table(n, min_fde_m=np.full(n, e), scenario=[s] * n, population=[population] * n)
            for (s, n), e in zip(per_scenario.items(), errors, strict=True)
        )

    # the rare crowd is 1 m worse on one road and 3 m on the other; its mix of roads differs and must not matter
    both = pl.concat([side(EVERYDAY, (1.0, 5.0), {"a": 60, "b": 180}), side(RARE, (2.0, 8.0), {"a": 180, "b": 60})])
    found = {one.scenario: one.change["min_fde_m"] for one in degradation(both, seed=0)}
    assert {name: round(one.value, 9) for name, one in found.items()} == {"all": 2.0, "a": 1.0, "b": 3.0}
    assert (found["a"].n_drivers, found["a"].n_units, found["a"].status) == (60, 10, "general")
    assert (found["all"].n_drivers, found["all"].n_units) == (120, 20)


def test_too_few_drivers_of_one_population_are_refused_for_all():
    both = pl.concat(table(n, scenario=["a"] * n, population=[name] * n) for name, n in ((EVERYDAY, 60), (RARE, 12)))
    assert all(one.change["min_fde_m"].refused for one in degradation(both, seed=0))


def test_other_draws_of_the_same_world_are_no_degradation(world, paired):
    found = stress(world.ConstantVelocity(), paired)
    change = found.degradation[0].change["min_fde_m"]
    assert change.low < 0 < change.high
    sides = [(EVERYDAY, EVERYDAY), (RARE, RARE), (EVERYDAY, RARE)]
    assert [(one.by, one.calibrated_on, one.judged_on) for one in found.coverage] == [
        (by, *side) for side in sides for by in ("commanded", "commanded*scenario")
    ]
    assert all(0.8 < one.regions[0].pooled_coverage.value <= 1.0 for one in found.coverage)
    assert found.reliability == ()  # one mode


def test_probabilities_that_mean_what_they_say_have_no_error():
    rng = np.random.default_rng(1)
    n = 6000
    best = np.where(rng.random(n) < 0.75, 0.75, 0.25)
    windows = table(n, best_probability=best, mode_probability=[[0.75, 0.25]] * n)
    honest = reliability(windows, group="all", seed=0, modes=6)
    assert honest.error.value < 0.02
    sure = windows.with_columns(
        mode_probability=pl.Series([[0.95, 0.05]] * n), best_probability=np.where(best > 0.5, 0.95, 0.05)
    )
    overconfident = reliability(sure, group="all", seed=0, modes=6)
    assert overconfident.error.value == pytest.approx(0.2, abs=0.02)
    assert overconfident.error.low < overconfident.error.value < overconfident.error.high
    assert overconfident.came_true[-1] == pytest.approx(0.75, abs=0.02)


def test_windows_see_the_event_and_who_caused_it_is_apart(world, tmp_path):
    from dataclasses import replace

    event = {"kind": "hard_brake", "time_s": 6.0, "actor": "car2", "victim": "car3"}
    scenes = [replace(world.scene(e), metadata={"events": [event] if e < 36 else []}) for e in range(40)]
    corpus = world.write(tmp_path / "events", scenes, with_labels=False)
    found = stress(world.ConstantVelocity(), own_traffic(corpus))
    sizes = {one.value: one.n_windows for one in found.events}
    assert sizes == {
        "hard_brake": 36 * 2,
        "hard_brake, actor": 36 * 2,
        NO_EVENT: found.evaluation.overall.n_windows - 72,
    }
    assert found.evaluation.counts[CAUSED] == 72
    late = pl.DataFrame({"scene_id": [scenes[0].scene_id], "agent_id": ["car3"], "t0_frame": [95]})
    late = late.with_columns(pl.col("t0_frame").cast(pl.Int32))
    assert with_events(late, corpus, future_s=6.0)["event"].to_list() == [NO_EVENT]  # 3.5 s after it


def test_saved_and_loaded(found, tmp_path):
    path = found.save(tmp_path / "mine")
    assert load_stress(path) == json.loads(json.dumps(found.to_dict()))
    made = {one.name for one in tmp_path.iterdir()}
    assert made == {"mine.json", "mine.md", "mine.parquet", "mine.stress.json", "mine.decisions.parquet"}
    with pytest.raises(InputError, match="no stress test"):
        load_stress(tmp_path / "mine.json")
    with pytest.raises(InputError, match="no such file"):
        load_stress(tmp_path / "other.json")
